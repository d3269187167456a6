"""How faithful distilled controllers are, over many seeds: a part of docs/rules.md.

    python -m fnnq_torchrl.rules run=DIR page=docs/rules.md

writes the table between the page's two marks.
"""

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.agent.rules import RulesError
from fnnq_torchrl.agent.rules.controller import Stretch
from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.rules.job import Job
from fnnq_torchrl.studies.rules.replay import distilled, greedy, replay
from fnnq_torchrl.studies.statistics import bootstrap_interval, paired_difference

BEGIN, END = "<!-- faithfulness -->\n", "<!-- end of faithfulness -->\n"

Numbers = NDArray[np.float64]


def write_faithfulness(job: Job, page: Path) -> None:
    """Write the table into a page, between the two marks.

    Raises:
        OSError: the page can't be read or written.
        RulesError: it has no marks, or the test doesn't count successes.
    """
    text = page.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise RulesError(f"{page}: has no lines {BEGIN.strip()} and {END.strip()}")
    new = f"{before}{BEGIN}{faithfulness(job)}{END}{after}"
    with atomic_write(page) as file:
        file.write(new.encode())


def faithfulness(job: Job) -> str:
    """The table: successes of all runs by the best action and by the distilled controller."""
    best = job.config.best_score
    if best is None:
        raise RulesError(f"{job.directory}: its test counts no successes")
    controllers = [job.rules(weights).controller() for weights in job.weights]
    system = controllers[0].distilled
    numbers = torch.stack([controller.distilled.consequents for controller in controllers])
    full = replay(job, job.seeds, job.weights, lambda each: greedy(job, each))
    short = replay(job, job.seeds, numbers, lambda each: distilled(job, system, each))
    scores: list[Numbers] = [each.successes.double().numpy() for each in (full, short)]
    difference = paired_difference(scores[1], scores[0]).mean
    means = np.array([controller.mean_difference for controller in controllers])
    largest = np.array([controller.largest_difference for controller in controllers])
    switches = np.array([_sides(controller.stretches) for controller in controllers])
    rows = [
        [words, interval_words(bootstrap_interval(np.mean, score)), f"{(score == best).mean():.0%}"]
        for words, score in zip(("best action", "distilled controller"), scores, strict=True)
    ]
    one = (switches == 1).mean()
    return (
        f"Over {len(job.seeds):,} seeds, in the test after learning:\n\n"
        + table(["", f"successes of {best}", "all of them"], rows)
        + f"\nThe difference, of the same seeds: {interval_words(difference, signed=True)}. "
        f"Over the range of the bearing, the two actions differ by {means.mean():.2f} in the mean "
        f"and by {largest.mean():.2f} at most (means over the seeds). With {one:.0%} of the seeds "
        "the best action changes its side exactly once.\n"
    )


def _sides(stretches: list[Stretch]) -> int:
    """How often the action goes from one side of 0 to the other."""
    signs = [np.sign(each.action) for each in stretches if abs(each.action) > 1e-6]
    return int(np.count_nonzero(np.diff(signs)))
