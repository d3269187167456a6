"""Writes what becomes of Q where nothing was seen: ``python -m fnnq_torchrl.extrapolation``."""

import sys
from pathlib import Path

from fnnq_torchrl.arguments import page_parser
from fnnq_torchrl.atomic import atomic_write
from fnnq_torchrl.experiments import Experiment, NoResults, newest_experiment
from fnnq_torchrl.figures.style import save
from fnnq_torchrl.report import announce

from .findings import Findings, first_side
from .findings import Numbers as Catches
from .learners import Learner
from .page import write_page
from .pictures import FIGURES


def main() -> None:
    """Read ``sys.argv``; what goes wrong is one line on stderr and status 1."""
    arguments = page_parser("python -m fnnq_torchrl.extrapolation", __doc__).parse_args()
    try:
        sweep = newest_experiment(arguments.results, "value_functions")
        experiment = newest_experiment(arguments.results, "extrapolation")
        findings, constant = measure(experiment)
        write(findings, write_page(findings, constant, sweep), arguments.to)
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    announce(str(arguments.to / "extrapolation.md"))


def measure(experiment: Experiment) -> tuple[list[Findings], dict[str, Catches]]:
    """All there is to say of each value function, and its `first_side` where α isn't decreased.

    Raises:
        NoResults: a value function lacks one of the two, or see `Findings.of`.
        OSError, ValueError: a file can't be read.
    """
    findings, constant = [], {}
    for learner in map(Learner.of, experiment.jobs):
        if learner.config.alpha_decay == 1:
            constant[learner.kind] = first_side(learner)
        else:
            findings.append(Findings.of(learner))
            announce(f"measured {learner.kind}")
    if not findings or sorted(constant) != sorted(each.kind for each in findings):
        raise NoResults(
            f"{experiment.name} must have each value function with alpha_decay=1, and with less"
        )
    return findings, constant


def write(findings: list[Findings], page: str, to: Path) -> None:
    """Write the page and its figures, as PNG and SVG.

    Raises:
        OSError: a file can't be written.
    """
    pictures = to / "figures"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        figure = draw({each.kind: each for each in findings})
        for suffix in (".png", ".svg"):
            save(figure, (pictures / name).with_suffix(suffix))
    with atomic_write(to / "extrapolation.md") as file:
        file.write(page.encode())


if __name__ == "__main__":
    main()
