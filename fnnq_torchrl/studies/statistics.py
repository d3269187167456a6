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
"""Takes samples, ``[..., n]`` each, and the axis −1; gives the statistic, ``[...]``."""

_MOST_FOR_BCA = 1000
"""Runs up to which intervals are corrected for bias and skew. That takes work that grows with the
square of their number, and the correction shrinks with their number's root.
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

    BCa (B. Efron, "Better bootstrap confidence intervals", JASA 82, 1987) up to 1,000 runs, then
    the plain percentiles, as well as where BCa is not defined: where leaving out any single run
    changes nothing.

    Args:
        statistic: vectorised.
        *samples: each ``[runs]``; several belong together run by run, and are drawn together.
        confidence: probability with which the interval covers the expectation, in (0, 1).
        resamples: how often the runs are drawn, with replacement.
        seed: of the draws: the same samples have the same interval.

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
        # Told below, by NaN.
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
    """The mean of the middle half: a quarter of the runs is cut off at either end.

    Less at the mercy of single runs than the mean, more of it used than by the median (R. Agarwal
    et al., "Deep reinforcement learning at the edge of the statistical precipice", NeurIPS 2021).
    """
    return trim_mean(samples, 0.25, axis=axis)


def improvement(ours: ArrayLike, theirs: ArrayLike, axis: int = -1) -> Any:
    """P(a run of ours scores more than a run of theirs), draws counting half.

    The Mann–Whitney statistic over all pairs of runs, divided by their number.

    Args:
        ours, theirs: scores, along ``axis``.
    """
    first, second = (np.moveaxis(np.asarray(scores), axis, -1) for scores in (ours, theirs))
    n, m = first.shape[-1], second.shape[-1]
    ranks = rankdata(np.concatenate([first, second], axis=-1), axis=-1)
    return (ranks[..., :n].sum(-1) - n * (n + 1) / 2) / (n * m)


class Difference(NamedTuple):
    """How one configuration differs from another over the same seeds."""

    mean: Interval  # of the runs' differences, in the scores' own unit
    effect: float  # that mean in standard deviations of the runs' differences
    improvement: (
        Interval  # the probability that a run of the first scores more than one of the other
    )
    runs_needed: float  # to see the difference, of so many seeds


def paired_difference(
    ours: ArrayLike, theirs: ArrayLike, confidence: float = 0.95, seed: int = 0
) -> Difference:
    """The difference of two configurations' scores, run by run.

    Args:
        ours, theirs: each run's score, ``[runs]``, by the same seeds in the same order.
        confidence: of the intervals.
        seed: of the bootstrap.

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
    """One of several choices."""

    choice: int
    judged: NDArray[np.float64]  # its scores, of runs that had no say in the choice


def choose_by_half(scores: ArrayLike) -> Chosen:
    """The choice with the highest mean over the first half of the runs; the others judge it.

    Lest what chance favours be called the best.

    Args:
        scores: ``[choices, runs]``.

    Raises:
        ValueError: there are fewer than four runs.
    """
    scores = np.asarray(scores, np.float64)
    runs = scores.shape[1]
    if runs < 4:
        raise ValueError(f"{runs} runs are too few to choose by half of them")
    choice = int(scores[:, : runs // 2].mean(axis=1).argmax())
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
    """How many pairs of runs a paired t test needs to see an effect so often.

        n = ((z(½(1 + confidence)) + z(power)) / d)² + ½z(½(1 + confidence))²

    The normal approximation with W. C. Guenther's correction for t ("Sample size formulas for
    normal theory t tests", The American Statistician 35, 1981).

    Args:
        effect: d, the mean difference in standard deviations of the differences.
        confidence: of the two-sided test.
        power: the probability of seeing it.

    Returns:
        A whole number, at least 2; infinity for no effect, NaN for an unknown one.
    """
    z, z_power = norm.ppf(0.5 * (1 + confidence)), norm.ppf(power)
    if np.isnan(effect) or effect == 0:
        return float("nan") if np.isnan(effect) else float("inf")
    return float(max(2, np.ceil(((z + z_power) / effect) ** 2 + z**2 / 2)))
