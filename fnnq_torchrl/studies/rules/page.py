"""The comparison of learned and distilled controllers over many seeds, a part of docs/rules.md.

    python -m fnnq_torchrl.rules run=DIR page=docs/rules.md

writes the comparison between two marks (HTML comments) in the page, and a picture of the best run
into the folder ``figures`` beside it.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.agent.rules import RulesError
from fnnq_torchrl.agent.rules.controller import Stretch
from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.rules.comparison import compare
from fnnq_torchrl.studies.rules.job import BEST, Job, choose
from fnnq_torchrl.studies.rules.pictures import surface
from fnnq_torchrl.studies.rules.reading import read_run
from fnnq_torchrl.studies.statistics import bootstrap_interval, paired_difference
from fnnq_torchrl.training.pictures.style import save

BEGIN, END = "<!-- faithfulness -->\n", "<!-- end of faithfulness -->\n"

Numbers = NDArray[np.float64]


def write_faithfulness(job: Job, page: Path) -> None:
    """Write a job's comparison into a page, between :data:`BEGIN` and :data:`END`.

    The picture of the best run's Q is written to ``figures/rules.png`` beside the page.

    Raises:
        OSError: if a file can't be read or written.
        RulesError: if the page lacks a mark, or the job's test doesn't count successes.
    """
    text = page.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise RulesError(f"{page}: has no lines {BEGIN.strip()} and {END.strip()}")
    compared, best = faithfulness(job), choose(job, BEST)
    picture = page.parent / "figures" / "rules.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    save(surface(read_run(job, best)), picture)
    shown = f"![Q over the state and the action, with the best action](figures/{picture.name})\n"
    new = f"{before}{BEGIN}{compared}\n{shown}\nThe picture shows Q of {best.words}.\n{END}{after}"
    with atomic_write(page) as file:
        file.write(new.encode())


def faithfulness(job: Job) -> str:
    """Return the comparison in Markdown.

    It compares the test's successes of all runs under the best action and under the distilled
    controller.

    Raises:
        RulesError: if the job's test doesn't count successes, its runs have different labels, or
            nothing is lost because each rule has an action already.
    """
    best = job.config.best_score
    if best is None:
        raise RulesError(f"{job.directory}: its test doesn't count successes")
    if job.config.value.rules_choose:
        raise RulesError(f"{job.directory}: its controllers are exact, so there is no difference")
    compared = compare(job)
    controllers, inputs = compared.controllers, compared.controllers[0].distilled.inputs
    scores: list[Numbers] = [
        each.successes.double().numpy() for each in (compared.learned, compared.distilled)
    ]
    difference = paired_difference(scores[1], scores[0]).mean
    means = np.array([controller.mean_difference for controller in controllers])
    largest = np.array([controller.largest_difference for controller in controllers])
    rows = [
        [words, interval_words(bootstrap_interval(np.mean, score)), f"{(score == best).mean():.0%}"]
        for words, score in zip(("best action", "distilled controller"), scores, strict=True)
    ]
    changes = ""
    if len(inputs) == 1:
        switches = np.array([_sides(controller.stretches) for controller in controllers])
        changes = (
            f" For {(switches == 1).mean():.0%} of the seeds, the best action changes its sign "
            "exactly once over that range."
        )
    ranges = "range" if len(inputs) == 1 else "ranges"
    return (
        f"Over {len(job.seeds):,} seeds, in the test after learning:\n\n"
        + table(["", f"successes of {best}", f"seeds with {best} of {best}"], rows)
        + "\nThe distilled controller minus the best action, seed by seed: "
        f"{interval_words(difference, signed=True)} successes. "
        f"Over the {ranges} of the {' and the '.join(each.name for each in inputs)}, the two "
        f"actions differ by {means.mean():.2f} on average and by at most {largest.mean():.2f} "
        f"(means over the seeds).{changes}\n"
    )


def _sides(stretches: list[Stretch]) -> int:
    """Return the number of sign changes of the action over the stretches."""
    signs = [np.sign(each.action) for each in stretches if abs(each.action) > 1e-6]
    return int(np.count_nonzero(np.diff(signs)))
