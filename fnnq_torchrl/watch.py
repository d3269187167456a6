"""Draw a job's runs as a GIF and a PNG of stills: ``python -m fnnq_torchrl.watch run=DIR``.

A job without tests shows new situations, in which its runs act greedily.

Keys, each as key=value:

    run         the directory of a finished job
    to          the GIF to write (default: robot.gif in that directory); the stills have the
                same name with the ending .png
    seed        the seed of one run, or of several, as in 0,1,2 (default: the best run)
    when        after, before or both: the test after learning, before it, or both (default: after)
    situations  the number of the test's situations to draw (default: 1)
    every       the number of steps from one frame to the next (default: 2)
    size        the width of a panel in pixels (default: 360)
"""

import sys
from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.interrupted import leave_interrupted
from fnnq_torchrl.launch.streams import lasting_streams, one_line
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


@lasting_streams()
def main() -> None:
    """Run the command; report an error as one line on stderr and exit with status 2."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        sys.stdout.write(__doc__ or "")
        return
    try:
        for path in watch(_DEFAULTS | parse(sys.argv[1:], _DEFAULTS, ["run"])):
            sys.stdout.write(f"{path}\n")
    except (ConfigError, OSError, ValueError, TypeError) as error:
        sys.stderr.write(f"{one_line(error)}\n")
        sys.exit(2)
    except KeyboardInterrupt:
        leave_interrupted()


def watch(given: dict[str, str]) -> list[Path]:
    """Draw test situations of a job.

    Args:
        given: a value for every key of the command.

    Returns:
        The paths of the GIF and of the stills.

    Raises:
        ConfigError: if a value isn't allowed.
        OSError: if a file can't be read or written.
        TypeError: if the job's world has no pictures.
        ValueError: if the job's checkpoint is damaged.
    """
    situations, every, size_px = (whole(given, key) for key in ("situations", "every", "size"))
    if given["when"] not in _WHEN:
        raise ConfigError(f"when={given['when']}: must be {' or '.join(_WHEN)}")
    # Imported after the checks, because importing torch takes seconds.
    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.training.policies import best_seed
    from fnnq_torchrl.training.watching import play, write_gif, write_strip
    from fnnq_torchrl.training.weights import load_checkpoint

    directory = Path(given["run"])
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    config = to_config(checkpoint.config)
    most = config.evaluation.tests
    if situations > most > 0:
        raise ConfigError(f"situations={situations}: must be at most {most}, the size of the test")
    seeds = _seeds(given["seed"]) or [best_seed(directory)]
    films, titles = [], []
    for learned in _WHEN[given["when"]]:
        played = play(config, checkpoint, seeds, situations, learned=learned)
        for seed, of_seed in zip(seeds, played, strict=True):
            for number, film in enumerate(of_seed):
                films.append(film)
                of_run = f"run {seed}, " if len(seeds) > 1 else ""
                titles.append(f"{'after' if learned else 'before'} learning, {of_run}test {number}")
    to = Path(given["to"] or directory / "robot.gif")
    # The first row shows the runs before learning, the second row after it.
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
