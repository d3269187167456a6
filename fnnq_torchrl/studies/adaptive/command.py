"""Write the page on adaptive step sizes: ``python -m fnnq_torchrl.adaptive``."""

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.studies.figures.gallery import draw
from fnnq_torchrl.training.terminal import announce

from .page import write_page
from .weights import weights_part


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    arguments = page_parser("python -m fnnq_torchrl.adaptive", __doc__).parse_args()
    with one_line_errors():
        names = ("adaptive", "stability", "step_sizes", "meta_step_sizes", "step_sizes_car")
        adaptive, stability, *of_weights = (
            newest_experiment(arguments.results, name) for name in names
        )
        text = write_page(adaptive, stability, weights_part(*of_weights))
        drawn = {"adaptive": adaptive, "stability": stability, "step_sizes": of_weights[0]}
        draw(drawn, arguments.to / "figures")
        page = arguments.to / "adaptive.md"
        with atomic_write(page) as file:
            file.write(text.encode())
        announce(str(page))
