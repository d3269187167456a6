"""Write the page on the paper's claims: ``python -m fnnq_torchrl.reproduction``."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.studies.figures.gallery import draw
from fnnq_torchrl.training.terminal import announce

from .claim_sections import IN_SHORT, verdicts_in_short
from .general import GENERAL_EXPERIMENTS, GENERAL_FIGURES, with_general, write_general
from .page import EXPERIMENTS, FIGURES, write_page


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    parser = page_parser("python -m fnnq_torchrl.reproduction", __doc__)
    parser.add_argument(
        "--short",
        action="store_true",
        help=f"only print a table, made from the experiments {', '.join(IN_SHORT)}",
    )
    parser.add_argument(
        "--general",
        action="store_true",
        help="only write the page's second part anew, on the claims about Q(λ) in general",
    )
    arguments = parser.parse_args()
    with one_line_errors():
        if arguments.short:
            _print_short(arguments.results)
            return
        page = arguments.to / "reproduction.md"
        names = GENERAL_EXPERIMENTS if arguments.general else EXPERIMENTS + GENERAL_EXPERIMENTS
        experiments = {name: newest_experiment(arguments.results, name) for name in names}
        if arguments.general:
            text = with_general(page.read_text(encoding="utf-8"), write_general(experiments))
        else:
            text = write_page(experiments)
        arguments.to.mkdir(parents=True, exist_ok=True)
        with atomic_write(page) as file:
            file.write(text.encode())
        figures = GENERAL_FIGURES if arguments.general else FIGURES
        draw({name: experiments[of] for name, of in figures.items()}, arguments.to / "figures")
        announce(str(page))


def _print_short(results: Path) -> None:
    experiments = {name: newest_experiment(results, name) for name in IN_SHORT}
    table = Table("the paper says", "our verdict", "from")
    for claim, verdict, differences in verdicts_in_short(experiments):
        table.add_row(f"«{claim}»", verdict, "\n".join(differences))
    Console().print(table)
