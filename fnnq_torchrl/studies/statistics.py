"""Statistics over runs."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import DegenerateDataWarning, bootstrap, norm, rankdata, trim_mean


class Interval(NamedTuple):
    """An estimate and the bounds of its confidence interval."""

    value: float
    low: float
    high: float


Statistic = Callable[..., Any]
"""A function of one or more samples ``[..., n]`` and of ``axis=-1``, which returns ``[...]``."""

_MOST_FOR_BCA = 1000
"""The largest number of runs whose intervals are corrected for bias and skew (BCa).

The cost of BCa grows with the square of the number of runs, and its correction shrinks with the
square root of that number.
"""

_ELEMENTS_AT_ONCE = 4_000_000


def bootstrap_interval(
    statistic: Statistic,
    *samples: ArrayLike,
    confidence: float = 0.95,
    resamples: int = 1000,
    seed: int = 0,
) -> Interval:
    """A statistic of one or more samples with its bootstrap interval (`scipy.stats.bootstrap`).

    Up to 1,000 runs the interval is BCa (B. Efron, "Better bootstrap confidence intervals", JASA
    82, 1987). With more runs its bounds are percentiles of the resampled statistic. So they are if
    BCa is undefined because the statistic stays the same whichever run is left out. The bounds of a
    mean lie between the smallest and the largest number of the sample, so the interval of a bounded
    score stays within the score's bounds.

    Args:
        statistic: the statistic, vectorised.
        *samples: each ``[runs]``; several samples are paired run by run, and resampled together.
        confidence: the probability that the interval covers the expected value, in (0, 1).
        resamples: the number of bootstrap resamples.
        seed: the seed of the resampling, so that equal samples have equal intervals.

    Returns:
        The statistic and its bounds. The bounds are NaN for a single run.

    Raises:
        ValueError: if there are no runs, or the samples differ in length.
    """
    columns = [np.asarray(sample, dtype=np.float64) for sample in samples]
    runs = columns[0].size
    if runs == 0 or any(column.shape != (runs,) for column in columns):
        shapes = ", ".join(str(list(column.shape)) for column in columns)
        raise ValueError(f"samples must all be [runs], with at least one run; got {shapes}")
    value = float(statistic(*columns, axis=-1))
    if runs == 1:
        return Interval(value, np.nan, np.nan)
    if all(np.ptp(column) == 0 for column in columns):
        return Interval(value, value, value)
    with warnings.catch_warnings():
        # scipy warns and returns NaN bounds if BCa is undefined; they are replaced below.
        warnings.simplefilter("ignore", DegenerateDataWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        result = bootstrap(
            columns,
            statistic,
            paired=len(columns) > 1,
            vectorized=True,
            axis=-1,
            n_resamples=resamples,
            batch=max(1, _ELEMENTS_AT_ONCE // (runs * len(columns))),
            confidence_level=confidence,
            method="BCa" if runs <= _MOST_FOR_BCA else "percentile",
            rng=np.random.default_rng(seed),
        )
    low, high = result.confidence_interval
    if not (np.isfinite(low) and np.isfinite(high)):
        tail = (1 - confidence) / 2
        low, high = np.quantile(result.bootstrap_distribution, [tail, 1 - tail])
    return Interval(value, float(low), float(high))


def interquartile_mean(samples: ArrayLike, axis: int = -1) -> Any:
    """The mean of the middle half of the samples: a quarter is cut off at either end.

    It is less sensitive to single runs than the mean, and uses more of the runs than the median
    (R. Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice",
    NeurIPS 2021).

    Args:
        samples: an array of any shape.
        axis: the axis of the runs, over which the mean is taken.
    """
    return trim_mean(samples, 0.25, axis=axis)


def improvement(ours: ArrayLike, theirs: ArrayLike, axis: int = -1) -> Any:
    """The probability that a run of ours scores more than a run of theirs; a draw counts half.

    It is the Mann–Whitney statistic over all pairs of runs, divided by the number of pairs.

    Args:
        ours, theirs: the scores of two configurations, with their runs along ``axis``.
        axis: the axis of the runs, over which the probability is taken.
    """
    first, second = (np.moveaxis(np.asarray(scores), axis, -1) for scores in (ours, theirs))
    n, m = first.shape[-1], second.shape[-1]
    ranks = rankdata(np.concatenate([first, second], axis=-1), axis=-1)
    return (ranks[..., :n].sum(-1) - n * (n + 1) / 2) / (n * m)


@dataclass(frozen=True, eq=False)
class Difference:
    """The difference of two configurations' scores over the same seeds.

    Each number is computed when it is asked for, since bootstraps take time.

    Attributes:
        ours, theirs: each run's score, ``[runs]``, with the same seeds in the same order.
        confidence: the confidence level of both intervals, and of ``runs_needed``.
        seed: the seed of the bootstrap's resampling.
    """

    ours: NDArray[np.float64]
    theirs: NDArray[np.float64]
    confidence: float
    seed: int

    @cached_property
    def mean(self) -> Interval:
        """The mean of the runs' differences, in the unit of the scores."""
        return bootstrap_interval(
            np.mean, self.ours - self.theirs, confidence=self.confidence, seed=self.seed
        )

    @cached_property
    def improvement(self) -> Interval:
        """The probability that a run of ours scores more than a run of theirs (`improvement`)."""
        return bootstrap_interval(
            improvement, self.ours, self.theirs, confidence=self.confidence, seed=self.seed
        )

    @property
    def effect(self) -> float:
        """The mean difference in standard deviations of the runs' differences."""
        return standardised(self.ours - self.theirs)

    @property
    def runs_needed(self) -> float:
        """The number of seeds needed to see such a difference (`runs_needed`)."""
        return runs_needed(self.effect, self.confidence)


def paired_difference(
    ours: ArrayLike, theirs: ArrayLike, confidence: float = 0.95, seed: int = 0
) -> Difference:
    """The difference of two configurations' scores, run by run.

    Args:
        ours, theirs: each run's score, ``[runs]``, with the same seeds in the same order.
        confidence: the confidence level of both intervals, and of ``runs_needed``.
        seed: the seed of the bootstrap's resampling.

    Raises:
        ValueError: if there are no runs, or the two numbers of runs differ.
    """
    ours, theirs = np.asarray(ours, np.float64), np.asarray(theirs, np.float64)
    if ours.shape != theirs.shape or not ours.size:
        raise ValueError(
            f"ours {list(ours.shape)} and theirs {list(theirs.shape)} must have the same shape, "
            "with at least one run"
        )
    return Difference(ours, theirs, confidence, seed)


class Chosen(NamedTuple):
    """The index of the best choice, and its scores in the runs that did not choose it."""

    choice: int
    judged: NDArray[np.float64]


def choose_by_half(scores: ArrayLike) -> Chosen:
    """The choice with the highest mean over the first half of the runs, judged by the other half.

    If the same runs chose and judged, the best would look better than it is: the highest of several
    means is partly luck. A choice whose mean is NaN is never the best.

    Args:
        scores: the scores of each choice, ``[choices, runs]``.

    Raises:
        ValueError: if there are fewer than four runs, or the means of all choices are NaN.
    """
    scores = np.asarray(scores, np.float64)
    runs = scores.shape[1]
    if runs < 4:
        raise ValueError(
            f"{runs} runs are too few: half of them choose, the others judge; at least 4 are needed"
        )
    means = scores[:, : runs // 2].mean(axis=1)
    if np.isnan(means).all():
        raise ValueError("the scores of every choice are NaN: there is none to choose")
    choice = int(np.nanargmax(means))
    return Chosen(choice, scores[choice, runs // 2 :])


def standardised(differences: ArrayLike) -> float:
    """The mean divided by the standard deviation (Cohen's d of pairs); NaN for a single run."""
    differences = np.asarray(differences, np.float64)
    if differences.size < 2:
        return float("nan")
    mean, deviation = differences.mean(), differences.std(ddof=1)
    if deviation == 0:
        return float(np.copysign(np.inf, mean)) if mean else 0.0
    return float(mean / deviation)


def runs_needed(effect: float, confidence: float = 0.95, power: float = 0.8) -> float:
    """The number of pairs of runs that a paired t test needs to see an effect with a given power.

        n = ((z(½(1 + confidence)) + z(power)) / d)² + ½z(½(1 + confidence))²

    This is the normal approximation with W. C. Guenther's correction for t ("Sample size formulas
    for normal theory t tests", The American Statistician 35, 1981).

    Args:
        effect: the mean difference in standard deviations of the differences, d.
        confidence: one minus the level of the two-sided test.
        power: the probability that the test sees the effect.

    Returns:
        A whole number, at least 2; infinity for no effect, NaN for an unknown one.
    """
    z, z_power = norm.ppf(0.5 * (1 + confidence)), norm.ppf(power)
    if np.isnan(effect) or effect == 0:
        return float("nan") if np.isnan(effect) else float("inf")
    return float(max(2, np.ceil(((z + z_power) / effect) ** 2 + z**2 / 2)))
