"""Axis limits that a few outliers don't squeeze, and the marks that stand for the outliers."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Transform
from numpy.typing import ArrayLike

FEW = 0.2
"""Outliers are at most this share of the values."""

FAR = 2.5
"""The outliers' distance from the other values, at least, in units of those values' range."""

_MARGIN, _ROOM = 0.06, 0.16
"""Margins of an axis, in its length; the latter where marks need room."""

CUT_OFF = "arrowhead: a mean beyond the axis, in figures"
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
    outliers = _outliers(value[order])
    kept = order[outliers:]
    bottom = np.nanmin([value[kept], low[kept]])
    top = np.nanmax([value[kept], high[kept]])
    span = top - bottom or 1.0
    room = _ROOM if outliers else _MARGIN
    return Limits(float(bottom - room * span), float(top + _MARGIN * span))


def _outliers(rising: np.ndarray) -> int:
    """The number of values at the start that are few, and far from the others."""
    most = int(FEW * rising.size)
    for count in range(most, 0, -1):
        others = rising[count:]
        if others[0] - rising[count - 1] > FAR * np.ptp(others) > 0:
            return count
    return 0


def mark_below(axes: Axes, place: float, value: float, colour: str) -> None:
    """Mark a value below the axis at its place: an arrowhead and the value in figures."""
    _mark(axes, axes.get_xaxis_transform(), (place, 0.03), "v", (-7, 0), value, colour)


def mark_left(axes: Axes, place: float, value: float, colour: str) -> None:
    """Mark a value to the left of the axis in its row: an arrowhead and the value in figures."""
    _mark(axes, axes.get_yaxis_transform(), (0.015, place), "<", (7, 0), value, colour)


def _mark(
    axes: Axes,
    transform: Transform,
    at: tuple[float, float],
    marker: str,
    beside_pt: tuple[float, float],
    value: float,
    colour: str,
) -> None:
    axes.scatter(*at, marker=marker, s=22, color=colour, transform=transform)
    axes.annotate(
        f"{value:.2f}",
        at,
        beside_pt,
        xycoords=transform,
        textcoords="offset points",
        horizontalalignment="left" if beside_pt[0] > 0 else "right",
        verticalalignment="center",
        fontsize=7,
        color=colour,
    )
