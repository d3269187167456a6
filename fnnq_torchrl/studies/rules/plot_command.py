"""Draw a job's rules: one file for each picture.

    python -m fnnq_torchrl.plot run=DIR

memberships: the labels and the gaps between them. surface: Q over state and action, with the greedy
action as a line. consequents: the consequents during learning, if the job has kept snapshots.pt
(checkpoint.snapshots=true). episode: the robot's path, the firing strengths and the TD errors.

seed=best chooses the run (or mean, or a run's seed). situation=1 chooses the test's situation for
the episode. to=DIR is the directory for the files, by default the job's. format=png may be svg or
pdf. own=true imports your own classes.
"""

from collections.abc import Iterator
from pathlib import Path

from envs.pictures import Figure, own_style
from fnnq_torchrl.agent.rules import RulesError
from fnnq_torchrl.agent.rules.errors import shown
from fnnq_torchrl.launch.arguments import one_line_errors, read_words
from fnnq_torchrl.studies.rules import pictures
from fnnq_torchrl.studies.rules.command import chosen_run
from fnnq_torchrl.studies.rules.job import Chosen, Job
from fnnq_torchrl.studies.rules.reading import read_run
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.terminal import announce
from fnnq_torchrl.training.weights import load_snapshots

_FORMATS = ("png", "svg", "pdf")


def main() -> None:
    """Run the command. An error is one line on stderr and an exit status other than 0."""
    keys = ("run", "seed", "situation", "to", "format", "own")
    words = read_words("python -m fnnq_torchrl.plot", __doc__, keys)
    with one_line_errors():
        _run(words)


@own_style()
def _run(words: dict[str, str]) -> None:
    job, chosen = chosen_run(words)
    tests, given = job.config.evaluation.tests, words.get("situation", "1")
    if not given.isdecimal() or not 1 <= int(given) <= tests:
        raise RulesError(f"situation={shown(given)}: must be a whole number from 1 to {tests}")
    form = words.get("format", _FORMATS[0])
    if form not in _FORMATS:
        raise RulesError(f"format={shown(form)}: must be {' or '.join(_FORMATS)}")
    to = Path(words.get("to", job.directory))
    to.mkdir(parents=True, exist_ok=True)
    for name, figure in _figures(job, chosen, int(given) - 1):
        save(figure, to / f"{name}.{form}")
        announce(str(to / f"{name}.{form}"))


def _figures(job: Job, chosen: Chosen, situation: int) -> Iterator[tuple[str, Figure]]:
    reading = read_run(job, chosen)
    yield "memberships", pictures.memberships(reading)
    if chosen.rules.compares:
        yield "surface", pictures.surface(reading)
    else:
        announce("no picture of Q: in fuzzy Q-learning, no action has a Q of its own")
    snapshots = job.directory / "snapshots.pt"
    if snapshots.is_file():
        yield "consequents", pictures.consequents(job, chosen, load_snapshots(snapshots))
    else:
        announce(f"no picture of the consequents: {snapshots} doesn't exist")
    yield "episode", pictures.episode(reading, situation)
