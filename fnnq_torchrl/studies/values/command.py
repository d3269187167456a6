"""Write the page on value functions and its figures: ``python -m fnnq_torchrl.values``."""

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.terminal import announce

from .aloud import read_aloud
from .learners import CHOICES, FUZZY, WORLDS, find, read_learners
from .page import write_page
from .pictures import curves_figure, sweep_figure


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    arguments = page_parser("python -m fnnq_torchrl.values", __doc__).parse_args()
    with one_line_errors():
        sweep, judged = (
            newest_experiment(arguments.results, name) for name in ("values_sweep", "values")
        )
        learners = read_learners(sweep, judged)
        car, *_ = WORLDS
        aloud = [
            read_aloud(find(learners, car, value).judged.directory) for value in (FUZZY, CHOICES)
        ]
        text, pictures = write_page(learners, aloud), arguments.to / "figures"
        pictures.mkdir(parents=True, exist_ok=True)
        drawn = {
            "value_functions": curves_figure(learners),
            "value_functions_sweep": sweep_figure(learners),
        }
        for name, figure in drawn.items():
            for ending in ("png", "svg"):
                save(figure, pictures / f"{name}.{ending}")
        page = arguments.to / "value_functions.md"
        with atomic_write(page) as file:
            file.write(text.encode())
    announce(str(page))
