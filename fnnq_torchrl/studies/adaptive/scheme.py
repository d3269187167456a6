"""A step size over a range of α: how it does at its best, and how much α matters to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.reproduction.pool import same_seeds
from fnnq_torchrl.studies.statistics import Interval, choose_by_half, paired_difference

MEASURE = "mean_score"


@dataclass(frozen=True, eq=False)
class Scheme:
    """Scores of one step size with one λ.

    The best α and the worst are chosen by half of the seeds (`choose_by_half`).

    Attributes:
        before: the mean score of all runs before they learned.
        best_alpha: the best by the first half.
        at_best, at_worst: each run's score with that α, of the second half, ``[runs]``.
        over_alphas: each run's mean over all α, which is what an α drawn from them is worth,
            ``[runs]``.
        diverged: how many runs have, by α, rising.
    """

    before: float
    best_alpha: float
    at_best: NDArray[np.float64]
    at_worst: NDArray[np.float64]
    over_alphas: NDArray[np.float64]
    diverged: dict[float, int]

    @property
    def spread(self) -> Interval:
        """How much more the best α scores than the worst."""
        return paired_difference(self.at_best, self.at_worst).mean


def read_scheme(experiment: Experiment, step_size: str, lam: float) -> Scheme:
    """The step size's jobs, one for each α of the experiment.

    Raises:
        NoResults: a job is missing, or has other seeds.
        ValueError: there are too few runs to be halved.
    """
    alphas = sorted(experiment.values("alpha"))
    runs = same_seeds(experiment.jobs)
    jobs = [experiment.job(step_size=step_size, lam=lam, alpha=alpha) for alpha in alphas]
    scores = np.stack([MEASURES[MEASURE].of(job.evaluations)[:runs] for job in jobs])
    best, worst = choose_by_half(scores), choose_by_half(-scores)
    return Scheme(
        before=float(np.mean([job.evaluations.catches[:, 0] for job in jobs])),
        best_alpha=alphas[best.choice],
        at_best=best.judged,
        at_worst=-worst.judged,
        over_alphas=scores.mean(axis=0),
        diverged={job.settings["alpha"]: job.evaluations.diverged_runs for job in jobs},
    )


def held_back(experiment: Experiment, lam: float) -> list[float]:
    """The α at which the α bound changed what came of a run: else it was never below α.

    Raises:
        NoResults: a job is missing.
    """

    def differ(alpha: float) -> bool:
        bound, constant = (
            experiment.job(step_size=step_size, lam=lam, alpha=alpha).evaluations
            for step_size in ("alpha_bound", "constant")
        )
        return not np.array_equal(bound.steps, constant.steps)

    return [alpha for alpha in sorted(experiment.values("alpha")) if differ(alpha)]
