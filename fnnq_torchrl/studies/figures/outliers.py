"""Axis limits that a few outlying values don't squeeze, and the marks that stand for those values."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

FEW = 0.2
"""Outliers are at most this share of the values."""

FAR = 2.5
"""The outliers' distance from the other values, at least, in units of those values' range."""

_MARGIN = 0.06

CUT_OFF = "arrow: beyond the axis, with its mean"
"""The words for a caption where `mark_below` or `mark_left` was used."""


class Limits(NamedTuple):
    """The limits of an axis. Values below ``low`` are outliers, to be marked at the edge."""

    low: float
    high: float


def limits(values: ArrayLike, lows: ArrayLike, highs: ArrayLike) -> Limits:
    """Axis limits around values and their intervals, but for a few values far below the others.

    Args:
        values: estimates, of any shape.
        lows, highs: the bounds of their intervals, shaped alike; NaN where there is none.

    Returns:
        The limits, with a margin on either side.
    """
    value, low, high = (np.ravel(np.asarray(each, np.float64)) for each in (values, lows, highs))
    order = np.argsort(value)
    kept = order[_outliers(value[order]) :]
    bottom = np.nanmin([value[kept], low[kept]])
    top = np.nanmax([value[kept], high[kept]])
    margin = _MARGIN * (top - bottom) or 1.0
    return Limits(float(bottom - margin), float(top + margin))


def _outliers(rising: np.ndarray) -> int:
    """The number of values at the start that are few, and far from the others."""
    most = int(FEW * rising.size)
    for count in range(most, 0, -1):
        others = rising[count:]
        if others[0] - rising[count - 1] > FAR * np.ptp(others) > 0:
            return count
    return 0


def mark_below(axes: Axes, place: float, value: float, colour: str) -> None:
    """Mark a value below the axis at its place, with an arrow and the value in figures."""
    axes.annotate(
        f"{value:.2f}",
        xy=(place, 0),
        xytext=(place, 0.09),
        xycoords=axes.get_xaxis_transform(),
        textcoords=axes.get_xaxis_transform(),
        arrowprops={"arrowstyle": "-|>", "color": colour},
        horizontalalignment="center",
        fontsize=8,
        color=colour,
    )


def mark_left(axes: Axes, place: float, value: float, colour: str) -> None:
    """Mark a value to the left of the axis in its row, with an arrow and the value in figures."""
    axes.annotate(
        f"{value:.2f}",
        xy=(0, place),
        xytext=(0.06, place),
        xycoords=axes.get_yaxis_transform(),
        textcoords=axes.get_yaxis_transform(),
        arrowprops={"arrowstyle": "-|>", "color": colour},
        verticalalignment="center",
        fontsize=8,
        color=colour,
    )
