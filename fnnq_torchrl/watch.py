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

import difflib
import sys
from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError

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
        for path in watch(_parsed(sys.argv[1:])):
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
    situations, every, size_px = (_whole(given, key) for key in ("situations", "every", "size"))
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
                moment = "after" if learned else "before"
                titles.append(f"{moment} learning, run {seed}, test {number}")
    to = Path(given["to"] or directory / "robot.gif")
    write_gif(films, titles, to, size_px=size_px, every=every)
    stills = to.with_suffix(".png")
    write_strip(films[-1], titles[-1], stills, size_px=size_px)
    return [to, stills]


def _parsed(words: list[str]) -> dict[str, str]:
    given = dict(_DEFAULTS)
    for word in words:
        key, equals, value = word.partition("=")
        if key not in given:
            near = difflib.get_close_matches(key, given, n=1)
            advice = f"did you mean {near[0]}=…?" if near else f"there is {', '.join(given)}"
            raise ConfigError(f"{word}: {advice}")
        if not (equals and value):
            raise ConfigError(f"{word}: must be {key}=…")
        given[key] = value
    if not given["run"]:
        raise ConfigError("run=DIR is missing: the directory of a finished job")
    return given


def _whole(given: dict[str, str], key: str) -> int:
    if not (given[key].isdecimal() and int(given[key]) >= 1):
        raise ConfigError(f"{key}={given[key]}: must be a whole number >= 1")
    return int(given[key])


def _seeds(text: str) -> list[int]:
    if not all(part.isdecimal() for part in text.split(",") if text):
        raise ConfigError(f"seed={text}: must be whole numbers, as in 0,1,2")
    return [int(part) for part in text.split(",") if text]


if __name__ == "__main__":
    main()
