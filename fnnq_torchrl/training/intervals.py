"""The interval of a mean over runs."""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit  # scipy.stats has it too, but takes long to import


class MeanInterval(NamedTuple):
    """A mean and the bounds of its confidence interval, each shaped like the reduced samples."""

    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def mean_interval(
    samples: ArrayLike,
    axis: int = 0,
    confidence: float = 0.95,
    bounds: tuple[float, float] = (-inf, inf),
) -> MeanInterval:
    """Mean over ``axis``, normally the runs, with Student's t interval of that mean.

        mean ± t(½(1 + confidence), n − 1) · s / √n

    Of a bounded score, the part of the interval beyond the bounds is cut off. The expectation can't
    lie there, so the interval covers it exactly as often as without the cut.

    Args:
        samples: numbers or an array of them, independent of each other along ``axis``.
        axis: along which the n samples lie; each place on the other axes is a case of its own.
        confidence: probability with which the interval covers the expectation, in (0, 1); exact
            for normal samples, approximate for others.
        bounds: the lowest and the highest possible sample.

    Returns:
        The mean and the bounds of the interval, in the samples' own unit and without ``axis``. The
        latter are NaN for n = 1, since one sample says nothing about the spread.

    Raises:
        ValueError: no samples along ``axis``, or ``confidence`` outside (0, 1).
    """
    samples = np.asarray(samples, dtype=np.float64)
    n = samples.shape[axis]
    if n == 0:
        raise ValueError("mean_interval needs at least one sample, got none")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie between 0 and 1, got {confidence}")

    # Measured from the first sample, equal samples have exactly their own mean and no spread.
    origin = samples.take(0, axis=axis)
    deviations = samples - np.expand_dims(origin, axis)
    mean = np.asarray(origin + deviations.mean(axis=axis))
    if n == 1:
        unknown = np.full_like(mean, np.nan)
        return MeanInterval(mean, unknown, unknown)
    standard_error = deviations.std(axis=axis, ddof=1) / np.sqrt(n)
    half_width = stdtrit(n - 1, 0.5 * (1.0 + confidence)) * standard_error
    lowest, highest = bounds
    return MeanInterval(
        mean, np.maximum(mean - half_width, lowest), np.minimum(mean + half_width, highest)
    )
