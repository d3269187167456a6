"""The charts of the report, as Vega-Lite specifications with their data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.config.schema import ConfigError

COLOURS = 7
"""The number of colours; a chart has at most as many lines."""

_DIGITS = 5
_MOST_POINTS = 201

Spec = dict[str, Any]


class Missing(ValueError):
    """A part of the report that can't be made; the message says why, in a sentence."""


@dataclass(frozen=True)
class Chart:
    """A chart.

    Attributes:
        title: the title.
        spec: the Vega-Lite specification, without colours, which the page sets.
        alt: the content in a sentence, for readers who can't see it.
        legend: the name of each line, in the order of the colours; none for a single line.
        note: a remark below the chart.
    """

    title: str
    spec: Spec
    alt: str
    legend: list[str] = field(default_factory=list)
    note: str = ""


@dataclass(frozen=True)
class Line:
    """A line of a chart, with a band around it.

    Attributes:
        name: the name.
        x, y: the points, ``[n]``.
        low, high: the bounds of the band, ``[n]``; NaN without one.
    """

    name: str
    x: ArrayLike
    y: ArrayLike
    low: ArrayLike | None = None
    high: ArrayLike | None = None


@cache
def libraries() -> str:
    """Return Vega, Vega-Lite and Vega-Embed, which draw the charts, as one JavaScript module.

    Raises:
        ConfigError: if the extra ``report`` isn't installed.
    """
    try:
        from vl_convert import javascript_bundle
    except ModuleNotFoundError as error:
        raise ConfigError(f"the report's charts need vl-convert; {installing('report')}") from error
    return javascript_bundle("globalThis.vegaEmbed = vegaEmbed;")


def line_chart(
    lines: Sequence[Line],
    x: str,
    y: str,
    *,
    title: str,
    alt: str,
    bounds: Sequence[float] | None = None,
    note: str = "",
) -> Chart:
    """Return a chart with a line and a band for each of at most `COLOURS` lines.

    Args:
        lines: the lines.
        x, y: the words for the axes, with units.
        title, alt, note: as in `Chart`.
        bounds: the ends of the vertical axis; by default those of the data.
    """
    values = [value for number, line in enumerate(lines) for value in _points(number, line)]
    scale = {"domain": [*bounds], "clamp": True} if bounds else {"zero": False}
    colour = {
        "field": "line",
        "type": "nominal",
        "scale": {"domain": [*range(len(lines))]},
        "legend": None,
    }
    told = [
        {"field": "name", "type": "nominal", "title": "line"},
        {"field": "x", "type": "quantitative", "title": x},
        {"field": "y", "type": "quantitative", "title": y, "format": ".3f"},
    ]
    if banded := any("low" in value for value in values):
        told += [
            {"field": end, "type": "quantitative", "title": words, "format": ".3f"}
            for end, words in (("low", "interval from"), ("high", "to"))
        ]
    across = {"field": "x", "type": "quantitative", "title": x}
    up = {"field": "y", "type": "quantitative", "title": y, "scale": scale}
    band = {
        "mark": {"type": "area", "opacity": 0.2, "aria": False},
        "encoding": {
            "x": across,
            "y": {"field": "low", "type": "quantitative", "title": y, "scale": scale},
            "y2": {"field": "high"},
            "color": colour,
        },
    }
    curve = {
        "mark": {"type": "line", "point": {"opacity": 0, "size": 90}, "aria": False},
        "encoding": {"x": across, "y": up, "color": colour, "tooltip": told},
    }
    spec = {
        "data": {"values": values},
        "height": 260,
        "layer": [band, curve] if banded else [curve],
    }
    legend = [line.name for line in lines] if len(lines) > 1 else []
    return Chart(title, spec, alt, legend, note)


def _points(number: int, line: Line) -> list[dict[str, Any]]:
    columns = {"x": line.x, "y": line.y}
    if line.low is not None and line.high is not None:
        columns |= {"low": line.low, "high": line.high}
    arrays = {name: np.asarray(column, np.float64) for name, column in columns.items()}
    size = arrays["x"].size
    shown = np.unique(np.linspace(0, size - 1, min(size, _MOST_POINTS)).round().astype(int))
    points = []
    for at in shown.tolist():
        point = {name: number_of(array[at]) for name, array in arrays.items()}
        known = {name: each for name, each in point.items() if each is not None}
        points.append({"line": number, "name": line.name} | known)
    return points


def interval_chart(
    rows: Sequence[Mapping[str, Any]], x: str, *, title: str, alt: str, note: str = ""
) -> Chart:
    """Return a chart with a dot and an interval for each row.

    Args:
        rows: each with its ``name``, ``value``, ``low`` and ``high``; the bounds may be None.
        x: the words for the axis, with the unit.
        title, alt, note: as in `Chart`.
    """
    order = [row["name"] for row in rows]
    axis = {"labelLimit": 190, "grid": True}
    up = {"field": "name", "type": "nominal", "sort": order, "title": None, "axis": axis}
    scale = {"zero": False, "nice": True}
    told = [{"field": "name", "type": "nominal", "title": "configuration"}]
    told += [
        {"field": each, "type": "quantitative", "title": words, "format": ".3f"}
        for each, words in (("value", "mean"), ("low", "interval from"), ("high", "to"))
    ]
    dot = {"field": "value", "type": "quantitative", "title": x, "scale": scale}
    spec = {
        "data": {"values": [*rows]},
        "height": 24 * len(rows),
        "encoding": {"y": up, "tooltip": told},
        "layer": [
            {
                "mark": {"type": "rule", "aria": False, "strokeWidth": 2},
                "encoding": {"x": dot | {"field": "low"}, "x2": {"field": "high"}},
            },
            {
                "mark": {"type": "point", "filled": True, "size": 70, "aria": False, "opacity": 1},
                "encoding": {"x": dot},
            },
        ],
    }
    return Chart(title, spec, alt, note=note)


def number_of(number: Any) -> float | None:
    """Return a number with a few significant digits, or None if it is NaN or infinite."""
    exact = float(number)
    return float(f"{exact:.{_DIGITS}g}") if isfinite(exact) else None
