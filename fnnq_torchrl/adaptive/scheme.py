"""A step size over a range of α: how it does at its best, and how much α matters to it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.experiments import Experiment, NoResults
from fnnq_torchrl.measures import MEASURES
from fnnq_torchrl.reproduction.pool import same_seeds

MEASURE = "mean_score"


@dataclass(frozen=True, eq=False)
class Scheme:
    """Scores of one step size with one λ.

    The best α is chosen by the first half of the seeds and judged by the second, lest what chance
    favours be called best.

    Attributes:
        best_alpha: the best by the first half.
        at_best: each run's score with it, of the second half, ``[runs]``.
        over_alphas: each run's mean over all α, which is what an α drawn from them is worth,
            ``[runs]``.
        spread: the best α's mean over all runs less the worst's.
    """

    best_alpha: float
    at_best: NDArray[np.float64]
    over_alphas: NDArray[np.float64]
    spread: float


def read_scheme(experiment: Experiment, step_size: str, lam: float) -> Scheme:
    """The step size's jobs, one for each α of the experiment.

    Raises:
        NoResults: a job is missing, has other seeds, or all have too few runs to be halved.
    """
    alphas = sorted(experiment.values("alpha"))
    runs = same_seeds(experiment.jobs)
    if runs < 4:
        raise NoResults(f"{experiment.name} has {runs} seeds, too few to choose α by half of them")
    jobs = [experiment.job(step_size=step_size, lam=lam, alpha=alpha) for alpha in alphas]
    scores = np.stack([MEASURES[MEASURE].of(job.evaluations)[:runs] for job in jobs])
    chosen, judged = scores[:, : runs // 2], scores[:, runs // 2 :]
    best = int(chosen.mean(axis=1).argmax())
    return Scheme(
        best_alpha=alphas[best],
        at_best=judged[best],
        over_alphas=scores.mean(axis=0),
        spread=float(np.ptp(scores.mean(axis=1))),
    )
