"""Draw the figures of experiments: ``python -m fnnq_torchrl.figures``."""

from pathlib import Path

from fnnq_torchrl.launch.arguments import OneLineParser, one_line_errors
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.terminal import announce

from .gallery import FIGURES, draw


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1, or 2 for bad arguments."""
    parser = OneLineParser("python -m fnnq_torchrl.figures", description=__doc__)
    parser.add_argument(
        "names",
        nargs="*",
        metavar="figure",
        help=f"any of {', '.join(FIGURES)}; all if none is named",
    )
    parser.add_argument("--results", type=Path, default=Path("outputs"), help="default: outputs")
    parser.add_argument(
        "--to", type=Path, default=Path("outputs/figures"), help="default: outputs/figures"
    )
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.names if name not in FIGURES]:
        parser.error(f"there is no figure {unknown[0]}; there is {', '.join(FIGURES)}")
    with one_line_errors():
        experiments = {
            name: newest_experiment(arguments.results, FIGURES[name][0])
            for name in arguments.names or FIGURES
        }
        for path in draw(experiments, arguments.to):
            announce(str(path))
