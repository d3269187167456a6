"""Axis limits that leave out a few outliers, and marks at the edge in the outliers' places."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from envs.pictures import Axes, Transform

FEW = 0.2
"""The largest share of the values that may be outliers."""

FAR = 2.5
"""The smallest distance of outliers from the other values, in units of the others' range."""

_MARGIN, _ROOM = 0.06, 0.16
"""The margins of an axis, as shares of its range: the usual one, and one with room for marks."""

CUT_OFF = "arrowhead: a mean beyond the axis, in figures"
"""The caption's words for the marks of `mark_below` and `mark_left`."""


class Limits(NamedTuple):
    """The limits of an axis. Values below ``low`` are outliers, to be marked at the edge."""

    low: float
    high: float


def limits(values: ArrayLike, lows: ArrayLike, highs: ArrayLike) -> Limits:
    """Return axis limits around values and their intervals, except a few values far below the rest.

    Args:
        values: estimates, of any shape.
        lows, highs: the bounds of the estimates' intervals, in the same shape; NaN if unknown.

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
    """Return how many of the lowest values are outliers, given all values in rising order."""
    most = int(FEW * rising.size)
    for count in range(most, 0, -1):
        others = rising[count:]
        if others[0] - rising[count - 1] > FAR * np.ptp(others) > 0:
            return count
    return 0


def mark_below(axes: Axes, place: float, value: float, colour: str) -> None:
    """Mark a value that lies below the axis, by an arrowhead and the number at the lower edge."""
    _mark(axes, axes.get_xaxis_transform(), (place, 0.03), "v", (-7, 0), value, colour)


def mark_left(axes: Axes, place: float, value: float, colour: str) -> None:
    """Mark a value that lies left of the axis, by an arrowhead and the number at the left edge."""
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
