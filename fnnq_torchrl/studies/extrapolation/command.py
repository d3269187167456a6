"""Write the page on extrapolation: ``python -m fnnq_torchrl.extrapolation``."""

from pathlib import Path

from envs.pictures import own_style
from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import Experiment, NoResults, newest_experiment
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.terminal import announce

from .findings import Findings
from .forgetting import FirstSide
from .learners import Learner
from .page import write_page
from .pictures import FIGURES


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    arguments = page_parser("python -m fnnq_torchrl.extrapolation", __doc__).parse_args()
    with one_line_errors():
        sweep = newest_experiment(arguments.results, "value_functions")
        experiment = newest_experiment(arguments.results, "extrapolation")
        findings, constant = measure(experiment)
        write(findings, write_page(findings, constant, sweep), arguments.to)
        announce(str(arguments.to / "extrapolation.md"))


def measure(experiment: Experiment) -> tuple[list[Findings], list[FirstSide]]:
    """Measure the runs of an experiment.

    Returns:
        The findings on each value function that learned with a decaying α, and the catches on the
        first side of each value function that learned with a constant α.

    Raises:
        NoResults: if a value function has only jobs with a decaying α or only jobs with a constant
            α, fnnq or mlp is missing, or `Findings.of` lacks an evaluation.
        OSError, ValueError: if a file can't be read.
    """
    learners = [Learner.of(job) for job in experiment.jobs]
    constant = [each for each in learners if each.config.alpha_decay == 1]
    decaying = [each for each in learners if each.config.alpha_decay < 1]
    kinds = sorted(each.kind for each in decaying)
    if kinds != sorted({each.kind for each in constant} | {"fnnq", "mlp"}):
        raise NoResults(
            f"{experiment.name} needs fnnq and mlp, and each value function with alpha_decay=1 and "
            "with a smaller alpha_decay"
        )
    findings = []
    for learner in decaying:
        findings.append(Findings.of(learner))
        announce(f"measured {learner.kind}")
    return findings, [FirstSide.of(learner) for learner in constant]


@own_style()
def write(findings: list[Findings], page: str, to: Path) -> None:
    """Write the page, and its figures as PNG and SVG.

    Raises:
        OSError: if a file can't be written.
    """
    pictures = to / "figures"
    pictures.mkdir(parents=True, exist_ok=True)
    with atomic_write(to / "extrapolation.md") as file:
        file.write(page.encode())
    for name, draw in FIGURES.items():
        figure = draw({each.kind: each for each in findings})
        for suffix in (".png", ".svg"):
            save(figure, (pictures / name).with_suffix(suffix))
