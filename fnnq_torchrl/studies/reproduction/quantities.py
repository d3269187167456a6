"""The quantities by which the paper's general claims are judged, and words for their values."""

from collections.abc import Callable
from dataclasses import dataclass
from math import log2

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.chain import steps_to_learn, value_error
from fnnq_torchrl.studies.experiments import Job
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import Interval

from .markdown import interval_words
from .verdicts import MATTERS


@dataclass(frozen=True)
class Quantity:
    """A number of each run of a job.

    Attributes:
        words: its name.
        of: a function from a job to the runs' numbers, ``[runs]``.
        matters: the smallest difference that matters, in the unit of the numbers.
        least: the smallest difference that matters, in words.
        show: a mean in words.
        show_difference: a mean difference in words.
    """

    words: str
    of: Callable[[Job], NDArray[np.float64]]
    matters: float
    least: str
    show: Callable[[Interval], str] = interval_words
    show_difference: Callable[[Interval], str] = lambda mean: interval_words(mean, signed=True)


def factor_words(logarithm: Interval) -> str:
    """Return the factor of a difference of logarithms to base 2, as "× 0.21 [0.20, 0.22]"."""
    value, low, high = (2**each for each in logarithm)
    return f"× {value:.3g} [{low:.3g}, {high:.3g}]"


def _steps_words(logarithm: Interval) -> str:
    value, low, high = (2**each for each in logarithm)
    return f"{value:,.0f} [{low:,.0f}, {high:,.0f}]"


def percent_words(share: Interval, signed: bool = False) -> str:
    """Return a share in percent, as "98 % [97, 99]"."""
    value, low, high = (100 * each for each in share)
    sign = "+" if signed else ""
    return f"{value:{sign}.3g} % [{low:{sign}.3g}, {high:{sign}.3g}]"


SCORE = Quantity(
    "mean score",
    lambda job: MEASURES["mean_score"].of(job.evaluations),
    MATTERS,
    f"{MATTERS} catches",
)

STEPS = Quantity(
    "steps to learn",
    lambda job: np.log2(steps_to_learn(job)),
    log2(1.1),
    "a factor of 1.1",
    _steps_words,
    factor_words,
)
"""The logarithm of the steps: means are geometric, and differences are factors."""

VALUE_ERROR = Quantity("error of the values", value_error, 0.01, "0.01")

DIVERGED = Quantity(
    "runs that diverge",
    lambda job: job.evaluations.diverged[:, -1].astype(np.float64),
    0.05,
    "5 % of the runs",
    percent_words,
    lambda share: percent_words(share, signed=True),
)
