"""Write the page on prior knowledge and its figures: ``python -m fnnq_torchrl.prior``."""

from envs.pictures import own_style
from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.terminal import announce

from .arms import NOTHING, OPERATOR, ROUGH, WRONG, find, read_arms
from .page import write_page
from .pictures import curves_figure, rules_figure


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    arguments = page_parser("python -m fnnq_torchrl.prior", __doc__).parse_args()
    with one_line_errors(), own_style():
        arms = read_arms(newest_experiment(arguments.results, "prior"))
        text = write_page(arms)
        largest = max(arm.margin for arm in arms if arm.source == ROUGH)
        told = [find(arms, source, largest) for source in (ROUGH, WRONG, OPERATOR)]
        pictures = arguments.to / "figures"
        pictures.mkdir(parents=True, exist_ok=True)
        page = arguments.to / "prior.md"
        with atomic_write(page) as file:
            file.write(text.encode())
        rules = rules_figure([find(arms, NOTHING), *told])
        for name, figure in (("prior", curves_figure(arms)), ("prior_rules", rules)):
            for suffix in (".png", ".svg"):
                save(figure, (pictures / name).with_suffix(suffix))
        announce(str(page))
