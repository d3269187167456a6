"""Print the results of finished jobs, a row for each configuration.

    python -m fnnq_torchrl.results DIR…                # jobs, sweeps, experiments; default: outputs
    python -m fnnq_torchrl.results DIR… format=csv     # or markdown, or table

A row has the keys in which the configurations differ, and the scores with their 95 % intervals. A
run that several jobs have counts once. own=true imports your own classes.
"""

from pathlib import Path

from fnnq_torchrl.launch.arguments import one_line_errors, read_places
from fnnq_torchrl.launch.streams import one_line
from fnnq_torchrl.launch.words import one_of, truth
from fnnq_torchrl.studies.results.collect import collect
from fnnq_torchrl.studies.results.tables import FORMATS
from fnnq_torchrl.training.terminal import announce, say

_TOLD = 5


def main() -> None:
    """Run the command. An error is one line on stderr and an exit status other than 0."""
    places, words = read_places("python -m fnnq_torchrl.results", __doc__, ("format", "own"))
    with one_line_errors():
        _run(places, words)


def _run(places: list[Path], words: dict[str, str]) -> None:
    form = one_of("format", words.get("format", "table"), [*FORMATS])
    results = collect(places, own=truth("own", words.get("own", "false")))
    tell_left_out(results.left_out)
    if results.repeated:
        announce(
            f"{results.repeated:,} runs repeat a run of an earlier job, with the same "
            "configuration and seed; they count once"
        )
    say(FORMATS[form](results))


def tell_left_out(lines: list[str]) -> None:
    """Print a line for each job that is left out; of many, for the first ones."""
    for line in lines[:_TOLD]:
        announce(f"left out: {one_line(line)}")
    if len(lines) > _TOLD:
        announce(f"left out: {len(lines) - _TOLD:,} more jobs")
