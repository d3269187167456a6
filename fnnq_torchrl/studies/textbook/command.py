"""Write the page on the textbook's figures: ``python -m fnnq_torchrl.textbook``."""

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.terminal import announce

from .page import write_page
from .pictures import car_figure, walk_figure
from .returns import return_errors
from .walk import read_errors

CAR, TRACES, WALK = (f"sutton_barto_{number}" for number in ("12_10", "12_11", "12_6"))
"""The experiments that the page needs."""


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    arguments = page_parser("python -m fnnq_torchrl.textbook", __doc__).parse_args()
    with one_line_errors():
        car, traces, walk = (
            newest_experiment(arguments.results, name) for name in (CAR, TRACES, WALK)
        )
        errors = read_errors(walk) + return_errors(walk)
        page, pictures = arguments.to / "textbook.md", arguments.to / "figures"
        text = write_page(car, traces, errors)
        pictures.mkdir(parents=True, exist_ok=True)
        for ending in ("png", "svg"):
            save(car_figure(car), pictures / f"textbook_car.{ending}")
            save(walk_figure(errors), pictures / f"textbook_walk.{ending}")
        with atomic_write(page) as file:
            file.write(text.encode())
    announce(str(page))
