"""Draw what runs have learned: ``python -m fnnq_torchrl.watch run=DIR``, a GIF and stills.

Keys, each as key=value:

    run         the directory of a finished job
    to          the GIF to write (default: robot.gif in that directory); the stills go beside it
    seed        of one run, or of several, as in 0,1,2 (default: the first)
    when        after learning, before, or both
    situations  how many of the test's, from the first (default: 1)
    every       steps from one frame to the next (default: 2)
    size        width of a panel in pixels (default: 360)
"""

import sys
from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.words import parse, whole

_DEFAULTS = {
    "run": "",
    "to": "",
    "seed": "",
    "when": "after",
    "situations": "1",
    "every": "2",
    "size": "360",
}
_WHEN = {"after": [True], "before": [False], "both": [False, True]}


def main() -> None:
    """Read ``sys.argv``; a mistake is one line on stderr and status 2."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        sys.stdout.write(__doc__ or "")
        return
    try:
        for path in watch(parse(sys.argv[1:], _DEFAULTS, ["run"])):
            sys.stdout.write(f"{path}\n")
    except (ConfigError, OSError, ValueError, TypeError) as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        sys.exit(2)


def watch(given: dict[str, str]) -> list[Path]:
    """Draw what was asked for.

    Args:
        given: a value for every key.

    Returns:
        The files that were written.

    Raises:
        ConfigError, OSError, ValueError, TypeError: it can't be drawn.
    """
    situations, every, size_px = (whole(given, key) for key in ("situations", "every", "size"))
    if given["when"] not in _WHEN:
        raise ConfigError(f"when={given['when']}: must be {' or '.join(_WHEN)}")
    # After the checks: torch takes seconds to import.
    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.training.watching import play, write_gif, write_strip
    from fnnq_torchrl.training.weights import load_checkpoint

    directory = Path(given["run"])
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    config = to_config(checkpoint.config)
    most = config.evaluation.tests
    if situations > most:
        raise ConfigError(f"situations={situations}: must be at most {most}, the test's")
    seeds = _seeds(given["seed"]) or [int(checkpoint.seed[0])]
    films, titles = [], []
    for learned in _WHEN[given["when"]]:
        played = play(config, checkpoint, seeds, situations, learned=learned)
        for seed, of_seed in zip(seeds, played, strict=True):
            for number, film in enumerate(of_seed):
                films.append(film)
                of_run = f"run {seed}, " if len(seeds) > 1 else ""
                titles.append(f"{'after' if learned else 'before'} learning, {of_run}test {number}")
    to = Path(given["to"] or directory / "robot.gif")
    # Before learning above, after it below.
    columns = len(films) // 2 if given["when"] == "both" else None
    write_gif(films, titles, to, size_px=size_px, every=every, columns=columns)
    stills = to.with_suffix(".png")
    write_strip(films[-1], titles[-1], stills, size_px=size_px)
    return [to, stills]


def _seeds(text: str) -> list[int]:
    if not all(part.isdecimal() for part in text.split(",") if text):
        raise ConfigError(f"seed={text}: must be whole numbers, as in 0,1,2")
    return [int(part) for part in text.split(",") if text]


if __name__ == "__main__":
    main()
