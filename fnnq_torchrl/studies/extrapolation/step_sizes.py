"""Each value function's best step size, from a sweep on the ordinary task."""

from dataclasses import dataclass

import numpy as np

from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.reproduction.markdown import interval_words
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, choose_by_half

from .learners import kind_of


@dataclass(frozen=True)
class BestStep:
    """The best step size of a value function.

    Attributes:
        alpha: the α with the highest mean score over the first half of the seeds.
        score: the mean score with that α over the second half, in catches, with its interval.
        among: all α that were tried, rising.
    """

    alpha: float
    score: Interval
    among: list[float]

    @property
    def inside(self) -> bool:
        """Return whether the best α is neither the smallest nor the largest that was tried."""
        return self.among[0] < self.alpha < self.among[-1]


def best_steps(sweep: Experiment) -> dict[str, BestStep]:
    """Return the best step size of each kind of value function in a sweep over both.

    Raises:
        ValueError: there are too few seeds to choose by half of them (`choose_by_half`).
    """
    found = {}
    for kind in dict.fromkeys(kind_of(job.config) for job in sweep.jobs):
        jobs = [job for job in sweep.jobs if kind_of(job.config) == kind]
        alphas = [job.settings["alpha"] for job in jobs]
        best = choose_by_half([job.evaluations.mean_score[: sweep.runs] for job in jobs])
        score = bootstrap_interval(np.mean, best.judged)
        found[kind] = BestStep(alphas[best.choice], score, sorted(alphas))
    return found


def step_words(found: dict[str, BestStep], kind: str, alpha: float) -> list[str]:
    """Return a table row on a step size: the α used, the best α, its score, and a remark.

    Raises:
        NoResults: the sweep lacks this value function.
    """
    if kind not in found:
        raise NoResults(f"the sweep value_functions has no {kind}")
    best = found[kind]
    remarks = []
    if best.alpha != alpha:
        remarks.append("not the best of the sweep")
    if not best.inside:
        remarks.append("the best is at the sweep's edge")
    tried = f"{best.among[0]:g} to {best.among[-1]:g}"
    score = interval_words(best.score)
    return [f"`{kind}`", f"{alpha:g}", f"{best.alpha:g}", tried, score, "; ".join(remarks)]
