"""Draw a job's runs as a GIF and a PNG of stills: ``python -m fnnq_torchrl.watch run=DIR``.

A job without tests shows new situations, in which its runs act greedily.

Keys, each as key=value:

    run         the directory of a finished job
    to          the GIF to write (default: robot.gif in that directory); the stills have the
                same name with the ending .png
    seed        the seed of one run, or of several, as in 0,1,2 (default: the best run)
    when        after, before or both: the test after learning, before it, or both (default: after)
    situations  the number of the test's situations to draw, from the first (default: 1)
    every       the number of steps from one frame to the next (default: 2)
    size        the width of a panel in pixels (default: 360)
"""

import sys
from itertools import chain
from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.arguments import one_line_errors
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
_MOST_COLUMNS = 6  # an even number


def main() -> None:
    """Run the command; an error is one line on stderr and an exit status other than 0."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        sys.stdout.write(__doc__ or "")
        return
    with one_line_errors():
        for path in watch(_DEFAULTS | parse(sys.argv[1:], _DEFAULTS, ["run"])):
            sys.stdout.write(f"{path}\n")


def watch(given: dict[str, str]) -> list[Path]:
    """Draw test situations of a job.

    Args:
        given: a value for every key of the command.

    Returns:
        The paths of the GIF and of the stills.

    Raises:
        ConfigError: if a value isn't allowed, or the job's world has no picture.
        OSError: if a file can't be read or written.
        ValueError: if the job's checkpoint is damaged.
    """
    situations, every, size_px = (whole(given, key) for key in ("situations", "every", "size"))
    if given["when"] not in _WHEN:
        raise ConfigError(f"when={given['when']}: must be {' or '.join(_WHEN)}")
    # Imported after the checks, because importing torch takes seconds.
    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.training.policies import best_seed
    from fnnq_torchrl.training.watching import panel_title, play, write_gif, write_strip
    from fnnq_torchrl.training.weights import load_checkpoint

    directory = Path(given["run"])
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    config = to_config(checkpoint.config)
    most = config.evaluation.tests
    if situations > most > 0:
        raise ConfigError(f"situations={situations}: must be at most {most}, the size of the test")
    seeds = _seeds(given["seed"]) or [best_seed(directory)]
    moments = _WHEN[given["when"]]
    rows = []  # before learning, after learning, or both
    for learned in moments:
        played = play(config, checkpoint, seeds, situations, learned=learned)
        rows.append(
            [
                (film, panel_title(number, learned, seed if len(seeds) > 1 else None))
                for seed, of_seed in zip(seeds, played, strict=True)
                for number, film in enumerate(of_seed, start=1)
            ]
        )
    panels, columns = list(chain(*rows)), None
    if len(moments) == 2:
        columns = len(rows[0])
        if columns > _MOST_COLUMNS:  # before and after side by side, in rows of several pairs
            panels, columns = list(chain(*zip(*rows, strict=True))), _MOST_COLUMNS
    films, titles = zip(*panels, strict=True)
    to = Path(given["to"] or directory / "robot.gif")
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
