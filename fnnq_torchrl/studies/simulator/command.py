"""Write the page on learning among obstacles: ``python -m fnnq_torchrl.simulator``."""

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.terminal import announce

from .page import write_page


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    arguments = page_parser("python -m fnnq_torchrl.simulator", __doc__).parse_args()
    with one_line_errors():
        page = arguments.to / "simulator.md"
        text = write_page(newest_experiment(arguments.results, "simulator"))
        with atomic_write(page) as file:
            file.write(text.encode())
        announce(str(page))
