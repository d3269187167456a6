"""The confidence interval of a mean over runs."""

from math import atan, cos, exp, inf, lgamma, pi, sin, sqrt, tan
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class MeanInterval(NamedTuple):
    """Means and the bounds of their confidence intervals, each without the axis of the samples."""

    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def mean_interval(
    samples: ArrayLike,
    axis: int = 0,
    confidence: float = 0.95,
    bounds: tuple[float, float] = (-inf, inf),
) -> MeanInterval:
    """Return the mean over ``axis``, normally the runs, and its Student's t interval.

        mean ± t(½(1 + confidence), n − 1) · s / √n

    The interval is cut off at the bounds of the score. The expectation lies within these bounds, so
    cutting doesn't change the probability that the interval covers it.

    Args:
        samples: numbers that are independent of each other along ``axis``.
        axis: the axis of the n samples; each place on the other axes has its own mean.
        confidence: the probability that the interval covers the expectation, in (0, 1); exact for
            normal samples, approximate for others.
        bounds: the lowest and the highest possible sample.

    Returns:
        The mean and the bounds of the interval, in the samples' unit, of the samples' shape without
        ``axis``. For n = 1 the bounds are NaN, since one sample says nothing about the spread.

    Raises:
        ValueError: if there are no samples along ``axis``, or ``confidence`` is outside (0, 1).
    """
    samples = np.asarray(samples, dtype=np.float64)
    n = samples.shape[axis]
    if n == 0:
        raise ValueError("mean_interval needs at least one sample, got none")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1, got {confidence}")

    # Relative to the first sample, so that equal samples have an exact mean and no spread.
    origin = samples.take(0, axis=axis)
    deviations = samples - np.expand_dims(origin, axis)
    mean = np.asarray(origin + deviations.mean(axis=axis))
    if n == 1:
        unknown = np.full_like(mean, np.nan)
        return MeanInterval(mean, unknown, unknown)
    standard_error = deviations.std(axis=axis, ddof=1) / np.sqrt(n)
    half_width = student_t(n - 1, confidence) * standard_error
    lowest, highest = bounds
    return MeanInterval(
        mean, np.maximum(mean - half_width, lowest), np.minimum(mean + half_width, highest)
    )


def student_t(dof: int, confidence: float) -> float:
    """Return the t with P(|T| < t) = ``confidence``, T having Student's t distribution.

    SciPy has this quantile too, but importing SciPy would take longer than a job takes to learn.
    With t = √dof · tan θ, the probability is a finite sum (Abramowitz and Stegun, 26.7.3 and
    26.7.4), whose slope in θ is proportional to cos θ to the power of dof − 1.

    Args:
        dof: the degrees of freedom, at least 1.
        confidence: the probability, in (0, 1).
    """
    odd = dof % 2
    k = np.arange(1, dof // 2)
    # The ratio of each term to the one before, without cos² θ.
    ratios = 2 * k / (2 * k + 1) if odd else (2 * k - 1) / (2 * k)
    steepest = 2 * exp(lgamma((dof + 1) / 2) - lgamma(dof / 2)) / sqrt(pi)

    def inside(angle: float) -> float:
        terms = 1 + np.cumprod(ratios * cos(angle) ** 2).sum()
        if not odd:
            return float(sin(angle) * terms)
        return float(2 / pi * (angle + sin(angle) * cos(angle) * terms * (dof > 1)))

    # The probability is concave in θ and the normal quantile is below that of t, so that Newton's
    # steps approach θ from below, until they no longer grow.
    angle, before = atan(NormalDist().inv_cdf((1 + confidence) / 2) / sqrt(dof)), -1.0
    while angle > before:
        before = angle
        angle += (confidence - inside(angle)) / (steepest * cos(angle) ** (dof - 1))
    return sqrt(dof) * tan(before)
