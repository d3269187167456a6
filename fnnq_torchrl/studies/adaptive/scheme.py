"""The scores of a step size over a range of α: at the best α, at the worst, and on average."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.reproduction.pool import same_seeds
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS
from fnnq_torchrl.studies.statistics import Interval, choose_by_half, paired_difference
from fnnq_torchrl.training.results import Evaluations

MEASURE = "mean_score"


@dataclass(frozen=True)
class Unit:
    """The unit of scores, of which more is better.

    Attributes:
        name: the unit in words.
        matters: the smallest difference that matters; it is our choice.
        of: a function from evaluations to the runs' scores, ``[runs]``.
        before: the same for the scores before learning; NaN if there are none.
        digits: the digits after the point that are worth showing.
    """

    name: str
    matters: float
    of: Callable[[Evaluations], NDArray[np.float64]]
    before: Callable[[Evaluations], NDArray[np.float64]]
    digits: int

    def text(self, score: float) -> str:
        """Return a score or a difference of scores as text, without the unit."""
        return f"{score:z.{self.digits}f}"


CATCHES = Unit("catches", MATTERS, MEASURES[MEASURE].of, lambda each: each.score[:, 0], 2)
"""The mean score in catches, of five."""


@dataclass(frozen=True, eq=False)
class Scheme:
    """The scores of one step size with one λ.

    The first half of the seeds chooses the best α and the worst (`choose_by_half`).

    Attributes:
        before: the mean score of all runs before they learned.
        best_alpha: the best α by the first half of the seeds.
        at_best, at_worst: the scores of the second half of the seeds at the best α and at the worst
            α, ``[runs]`` each.
        over_alphas: each run's mean score over all α, ``[runs]``. It is the expected score of an α
            drawn at random from the range.
        diverged: the number of diverged runs by α, with α rising.
    """

    before: float
    best_alpha: float
    at_best: NDArray[np.float64]
    at_worst: NDArray[np.float64]
    over_alphas: NDArray[np.float64]
    diverged: dict[float, int]

    @property
    def alphas(self) -> list[float]:
        """The range of α, rising."""
        return [*self.diverged]

    @property
    def spread(self) -> Interval:
        """The difference between the scores at the best α and at the worst."""
        return paired_difference(self.at_best, self.at_worst).mean


def read_scheme(experiment: Experiment, step_size: str, lam: float, unit: Unit = CATCHES) -> Scheme:
    """Return the scores of a step size with one λ, from one job for each α of the experiment.

    Raises:
        NoResults: if a job is missing, or jobs have different seeds.
        ValueError: if there are too few runs for `choose_by_half`.
    """
    alphas = sorted(experiment.values("alpha"))
    same_seeds(experiment.jobs)
    return scheme_of(
        [experiment.job(step_size=step_size, lam=lam, alpha=alpha) for alpha in alphas], unit
    )


def scheme_of(jobs: Sequence[Job], unit: Unit = CATCHES) -> Scheme:
    """Return the scores of a scheme, from one job for each α, with α rising.

    Raises:
        NoResults: if the jobs have different seeds.
        ValueError: if there are too few runs for `choose_by_half`.
    """
    runs = same_seeds(jobs)
    scores = np.stack([unit.of(job.evaluations)[:runs] for job in jobs])
    best, worst = choose_by_half(scores), choose_by_half(-scores)
    return Scheme(
        before=float(np.mean([unit.before(job.evaluations) for job in jobs])),
        best_alpha=jobs[best.choice].settings["alpha"],
        at_best=best.judged,
        at_worst=-worst.judged,
        over_alphas=scores.mean(axis=0),
        diverged={job.settings["alpha"]: job.evaluations.diverged_runs for job in jobs},
    )


def held_back(experiment: Experiment, lam: float) -> list[float]:
    """Return each α whose runs with ``alpha_bound`` differ from the runs with a constant α.

    They differ if the bound was below α in some step.

    Raises:
        NoResults: if a job is missing.
    """

    def differ(alpha: float) -> bool:
        bound, constant = (
            experiment.job(step_size=step_size, lam=lam, alpha=alpha).evaluations
            for step_size in ("alpha_bound", "constant")
        )
        return not np.array_equal(bound.steps, constant.steps)

    return [alpha for alpha in sorted(experiment.values("alpha")) if differ(alpha)]
