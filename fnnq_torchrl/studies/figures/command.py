"""Draws the figures of all experiments: ``python -m fnnq_torchrl.figures``."""

import sys
from pathlib import Path

from fnnq_torchrl.launch.arguments import OneLineParser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.terminal import announce

from .gallery import FIGURES, draw


def main() -> None:
    """Read ``sys.argv``; a mistake is one line on stderr and status 2."""
    parser = OneLineParser("python -m fnnq_torchrl.figures", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="figure", help=f"of {', '.join(FIGURES)}")
    parser.add_argument("--results", type=Path, default=Path("outputs"), help="default: outputs")
    parser.add_argument("--to", type=Path, default=Path("outputs/figures"), help="default: there")
    arguments = parser.parse_args()
    if unknown := [name for name in arguments.names if name not in FIGURES]:
        parser.error(f"there is no figure {unknown[0]}; there is {', '.join(FIGURES)}")
    try:
        experiments = {
            name: newest_experiment(arguments.results, FIGURES[name][0])
            for name in arguments.names or FIGURES
        }
        for path in draw(experiments, arguments.to):
            announce(str(path))
    except (OSError, ValueError) as error:
        sys.exit(" ".join(str(error).split()))
