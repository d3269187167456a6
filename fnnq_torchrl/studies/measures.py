"""What a run's evaluations come to: one number a run, for figures and comparisons."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.training.results import FINAL_EVALUATIONS, Evaluations

EARLY_EVALUATIONS = 10
"""The early score is the mean over this many first evaluations after learning began."""


@dataclass(frozen=True)
class Measure:
    """A number of each run.

    Attributes:
        words: what to call it, with its unit, as a figure's axis does.
        meaning: how it comes about, in a clause.
        of: takes evaluations to ``[runs]``.
    """

    words: str
    meaning: str
    of: Callable[[Evaluations], NDArray[np.float64]]


def early_score(evaluations: Evaluations) -> NDArray[np.float64]:
    """Mean score of each run soon after learning began, ``[runs]``: how fast it learns."""
    return evaluations.score[:, 1:][:, :EARLY_EVALUATIONS].mean(axis=1)


def forgetting(evaluations: Evaluations) -> NDArray[np.float64]:
    """How far each run's score lies below the best that it has had, on average: ``[runs]``."""
    scores = evaluations.score[:, 1:]
    return (np.maximum.accumulate(scores, axis=1) - scores).mean(axis=1)


MEASURES = {
    "mean_score": Measure(
        "mean score (catches)",
        "the mean over all evaluations after learning began",
        lambda evaluations: evaluations.mean_score,
    ),
    "final_score": Measure(
        "final score (catches)",
        f"the mean over the last {FINAL_EVALUATIONS} evaluations",
        lambda evaluations: evaluations.final_score,
    ),
    "early_score": Measure(
        "early score (catches)",
        f"the mean over the first {EARLY_EVALUATIONS} evaluations after learning began",
        early_score,
    ),
    "forgetting": Measure(
        "forgetting (catches)",
        "how far the score lies below the run's best so far, the mean over its evaluations",
        forgetting,
    ),
}
