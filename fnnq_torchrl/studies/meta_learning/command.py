"""Write the page on meta-learning: ``python -m fnnq_torchrl.meta_learning``.

--ring prints the table of the ring alone, from ``+experiment=doya``.
"""

import sys

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.launch.arguments import one_line_errors, page_parser
from fnnq_torchrl.studies.experiments import newest_experiment
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.terminal import announce

from .page import CHANGES, ring_table, write_page
from .pictures import changing_figure, course_figure
from .ring import read_shares

RING, BALL, CHANGING = "doya", "meta_learning", "changing_ball"
"""The experiments that the page needs."""


def main() -> None:
    """Run the command. An error is one line on stderr and exit status 1."""
    parser = page_parser("python -m fnnq_torchrl.meta_learning", __doc__)
    parser.add_argument("--ring", action="store_true", help="print the ring's table and no page")
    arguments = parser.parse_args()
    with one_line_errors():
        ring = newest_experiment(arguments.results, RING)
        if arguments.ring:
            sys.stdout.write(ring_table(read_shares(ring)))
            return
        ball, changing = (newest_experiment(arguments.results, name) for name in (BALL, CHANGING))
        page, pictures = arguments.to / "meta_learning.md", arguments.to / "figures"
        text = write_page(ring, ball, changing)
        pictures.mkdir(parents=True, exist_ok=True)
        for ending in ("png", "svg"):
            save(course_figure(ball), pictures / f"meta_learning.{ending}")
            save(changing_figure(changing, CHANGES), pictures / f"changing_ball.{ending}")
        with atomic_write(page) as file:
            file.write(text.encode())
        announce(str(page))
