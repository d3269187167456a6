"""Statistics over runs."""

import warnings
from collections.abc import Callable
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
"""A function that takes samples, ``[..., n]`` each, and ``axis=-1``, and returns ``[...]``."""

_MOST_FOR_BCA = 1000
"""The largest number of runs whose intervals are corrected for bias and skew (BCa).

The work grows with the square of the number of runs, and the correction shrinks with its root.
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
    82, 1987). Beyond that, and where BCa is not defined because leaving out any single run changes
    nothing, it is the plain percentiles of the draws. The bounds of a mean lie between the smallest
    sample and the largest, so the interval of a bounded score stays within the score's bounds.

    Args:
        statistic: the statistic, vectorised.
        *samples: each ``[runs]``; several samples are paired run by run, and drawn together.
        confidence: probability with which the interval covers the expectation, in (0, 1).
        resamples: number of times that the runs are drawn, with replacement.
        seed: seed of the draws, so that the same samples have the same interval.

    Returns:
        The statistic and its bounds. The bounds are NaN for a single run.

    Raises:
        ValueError: no runs, or samples of different lengths.
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
        # scipy warns where BCa is undefined; its NaN bounds are dealt with below.
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

    Single runs sway it less than the mean, and it uses more of the runs than the median does
    (R. Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice",
    NeurIPS 2021).

    Args:
        samples: an array of any shape.
        axis: the axis of the runs, which the result lacks.
    """
    return trim_mean(samples, 0.25, axis=axis)


def improvement(ours: ArrayLike, theirs: ArrayLike, axis: int = -1) -> Any:
    """The probability that a run of ours scores more than a run of theirs; a draw counts half.

    It is the Mann–Whitney statistic over all pairs of runs, divided by the number of pairs.

    Args:
        ours, theirs: scores, whose runs lie along ``axis``.
        axis: the axis of the runs, which the result lacks.
    """
    first, second = (np.moveaxis(np.asarray(scores), axis, -1) for scores in (ours, theirs))
    n, m = first.shape[-1], second.shape[-1]
    ranks = rankdata(np.concatenate([first, second], axis=-1), axis=-1)
    return (ranks[..., :n].sum(-1) - n * (n + 1) / 2) / (n * m)


class Difference(NamedTuple):
    """The difference of two configurations' scores over the same seeds.

    Attributes:
        mean: the mean of the runs' differences, in the scores' own unit.
        effect: that mean in standard deviations of the runs' differences.
        improvement: the probability that a run of the first scores more than a run of the second.
        runs_needed: the number of seeds that it takes to see such a difference (`runs_needed`).
    """

    mean: Interval
    effect: float
    improvement: Interval
    runs_needed: float


def paired_difference(
    ours: ArrayLike, theirs: ArrayLike, confidence: float = 0.95, seed: int = 0
) -> Difference:
    """The difference of two configurations' scores, run by run.

    Args:
        ours, theirs: each run's score, ``[runs]``, with the same seeds in the same order.
        confidence: probability with which each interval covers its expectation.
        seed: seed of the bootstrap's draws.

    Raises:
        ValueError: no runs, or not the same number.
    """
    ours, theirs = np.asarray(ours, np.float64), np.asarray(theirs, np.float64)
    if ours.shape != theirs.shape:
        raise ValueError(f"ours {list(ours.shape)} and theirs {list(theirs.shape)} must be pairs")
    differences = ours - theirs
    mean = bootstrap_interval(np.mean, differences, confidence=confidence, seed=seed)
    better = bootstrap_interval(improvement, ours, theirs, confidence=confidence, seed=seed)
    effect = standardised(differences)
    return Difference(mean, effect, better, runs_needed(effect, confidence))


class Chosen(NamedTuple):
    """The index of the best choice, and its scores in the runs that had no say in choosing it."""

    choice: int
    judged: NDArray[np.float64]


def choose_by_half(scores: ArrayLike) -> Chosen:
    """The choice with the highest mean over the first half of the runs, judged by the other half.

    If the same runs chose and judged, the best would look better than it is: the highest of several
    means is partly luck. A choice whose mean is not a number is never the best.

    Args:
        scores: ``[choices, runs]``.

    Raises:
        ValueError: there are fewer than four runs, or no choice has a mean.
    """
    scores = np.asarray(scores, np.float64)
    runs = scores.shape[1]
    if runs < 4:
        raise ValueError(f"{runs} runs are too few to choose by half of them")
    means = scores[:, : runs // 2].mean(axis=1)
    if np.isnan(means).all():
        raise ValueError("the scores of every choice are NaN: there is none to choose")
    choice = int(np.nanargmax(means))
    return Chosen(choice, scores[choice, runs // 2 :])


def standardised(differences: ArrayLike) -> float:
    """Mean over standard deviation (Cohen's d of paired samples); NaN for a single run."""
    differences = np.asarray(differences, np.float64)
    if differences.size < 2:
        return float("nan")
    mean, deviation = differences.mean(), differences.std(ddof=1)
    if deviation == 0:
        return float(np.copysign(np.inf, mean)) if mean else 0.0
    return float(mean / deviation)


def runs_needed(effect: float, confidence: float = 0.95, power: float = 0.8) -> float:
    """The number of pairs of runs with which a paired t test sees an effect with a given power.

        n = ((z(½(1 + confidence)) + z(power)) / d)² + ½z(½(1 + confidence))²

    The normal approximation with W. C. Guenther's correction for t ("Sample size formulas for
    normal theory t tests", The American Statistician 35, 1981).

    Args:
        effect: d, the mean difference in standard deviations of the differences.
        confidence: one minus the level of the two-sided test.
        power: the probability that the test sees the effect.

    Returns:
        A whole number, at least 2; infinity for no effect, NaN for an unknown one.
    """
    z, z_power = norm.ppf(0.5 * (1 + confidence)), norm.ppf(power)
    if np.isnan(effect) or effect == 0:
        return float("nan") if np.isnan(effect) else float("inf")
    return float(max(2, np.ceil(((z + z_power) / effect) ** 2 + z**2 / 2)))
