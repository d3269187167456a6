"""Measures of a run: one number from all its evaluations, for figures and comparisons."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.training.results import FINAL_EVALUATIONS, Evaluations

EARLY_EVALUATIONS = 10
"""The number of evaluations after learning began whose mean is the early score."""


@dataclass(frozen=True)
class Measure:
    """A measure of runs.

    Attributes:
        words: its name with its unit, as on a figure's axis.
        meaning: its definition, in a clause.
        of: computes it from evaluations, ``[runs]``.
    """

    words: str
    meaning: str
    of: Callable[[Evaluations], NDArray[np.float64]]


def early_score(evaluations: Evaluations) -> NDArray[np.float64]:
    """Return each run's mean score soon after learning began, ``[runs]``: a measure of speed."""
    return evaluations.score[:, 1:][:, :EARLY_EVALUATIONS].mean(axis=1)


def forgetting(evaluations: Evaluations) -> NDArray[np.float64]:
    """Return by how much each run's score lies below its best so far, on average, ``[runs]``."""
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
