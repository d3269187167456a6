"""The figures of docs/extrapolation.md."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure
from fnnq_torchrl.studies.figures.lines import INTERVAL
from fnnq_torchrl.studies.statistics import bootstrap_interval
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import (
    COLOURS,
    GREY,
    LINES,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.results import CONFIDENCE

from .findings import INTERFERENCE_AFTER, Findings
from .interference import distances
from .movement import STATES
from .playing import TESTS

ByKind = Mapping[str, Findings]

MOMENTS = ("before learning", "after the left", "after the right")
_MEAN = f"line: mean over the runs; band: its {100 * CONFIDENCE:g} % interval (Student's t)"


def values_figure(by_kind: ByKind) -> Figure:
    """Draw V(Δθ) of each value function at three moments."""
    figure = new_figure(
        2.6 * len(by_kind) + 1,
        3.6,
        f"V = max Q against the bearing, {_runs(by_kind)} each",
        f"{_MEAN}; grey: seen while learning on the left; dotted: the head's field of view",
    )
    panels = figure.subplots(1, len(by_kind), sharey=True, squeeze=False)[0]
    for axes, (kind, findings) in zip(panels, by_kind.items(), strict=True):
        for moment, colour in zip(range(len(MOMENTS)), COLOURS, strict=False):
            _band(axes, _states(), findings.values[:, moment], colour, "-")
        _shade_seen(axes, findings)
        axes.set_title(kind, fontsize=10)
        axes.set_xlabel("bearing Δθ (rad)")
    panels[0].set_ylabel("V = max Q")
    figure.draw_without_rendering()
    label_ends(panels[-1], MOMENTS)
    return figure


def movement_figure(by_kind: ByKind) -> Figure:
    """Draw the movement of each value function's Q against the bearing."""
    figure = new_figure(
        2.6 * len(by_kind) + 1,
        3.6,
        f"Movement of Q while learning on the left, {_runs(by_kind)} each",
        f"{_MEAN}; grey: seen while learning on the left; dotted: the head's field of view",
    )
    panels = figure.subplots(1, len(by_kind), sharey=True, squeeze=False)[0]
    for axes, (kind, findings) in zip(panels, by_kind.items(), strict=True):
        _band(axes, _states(), findings.moved, COLOURS[0], "-")
        _shade_seen(axes, findings)
        axes.set_title(kind, fontsize=10)
        axes.set_xlabel("bearing Δθ (rad)")
        axes.set_ylim(bottom=0)
    panels[0].set_ylabel("movement (1 = mean where seen)")
    return figure


def interference_figure(by_kind: ByKind) -> Figure:
    """Draw interference against the distance between two states, at each `INTERFERENCE_AFTER`."""
    figure = new_figure(
        3.4 * len(INTERFERENCE_AFTER) + 1,
        4,
        f"Interference of one update, {_runs(by_kind)} each",
        _MEAN,
    )
    panels = figure.subplots(1, len(INTERFERENCE_AFTER), sharey=True)
    for i, (axes, after) in enumerate(zip(panels, INTERFERENCE_AFTER, strict=True)):
        for findings, (colour, style) in zip(by_kind.values(), LINES, strict=False):
            _band(axes, distances(), findings.spread[:, i], colour, style)
        axes.set_title(f"after {after} situations", fontsize=10)
        axes.set_xlabel("|s − s′| (rad)")
        axes.set_ylim(bottom=0)
        quiet_grid(axes)
    panels[0].set_ylabel("|ΔQ(s′, a)| / |ΔQ(s, a)|")
    figure.draw_without_rendering()
    label_ends(panels[-1], [*by_kind])
    return figure


def catches_figure(by_kind: ByKind) -> Figure:
    """Draw the catches on either side at three moments."""
    figure = new_figure(
        11,
        4,
        f"Greedy catches on either side, {_runs(by_kind)} each",
        f"dot: mean over the runs; bar: its {INTERVAL}",
    )
    panels = figure.subplots(1, 2, sharey=True)
    places = np.arange(len(MOMENTS))
    offsets = np.linspace(-0.1, 0.1, len(by_kind))  # so that no bar hides another
    for side, (axes, name) in enumerate(zip(panels, ("left", "right"), strict=True)):
        for findings, (colour, style), offset in zip(
            by_kind.values(), LINES, offsets, strict=False
        ):
            found = [bootstrap_interval(np.mean, x) for x in findings.caught[:, :, side].T]
            mean, low, high = np.transpose(found)
            beside = places + offset
            axes.plot(beside, mean, color=colour, linestyle=style, marker="o", markersize=4)
            axes.vlines(beside, low, high, color=colour)
        axes.set_title(f"the ball starts on the {name}", fontsize=10)
        axes.set_xticks(places, labels=MOMENTS)
        axes.set_xlim(-0.3, len(MOMENTS) - 0.7)
        axes.set_ylim(0, 1.03 * TESTS)
        quiet_grid(axes)
    panels[0].set_ylabel(f"catches of {TESTS}")
    figure.draw_without_rendering()
    label_ends(panels[-1], [*by_kind])
    return figure


FIGURES: dict[str, Callable[[ByKind], Figure]] = {
    "extrapolation_values": values_figure,
    "extrapolation_movement": movement_figure,
    "extrapolation_catches": catches_figure,
    "extrapolation_interference": interference_figure,
}
"""The functions that draw the page's figures, by the figures' file names."""


def _band(
    axes: Axes, x: NDArray[np.float64], samples: NDArray[np.float64], colour: str, style: str
) -> None:
    mean, low, high = mean_interval(samples, confidence=CONFIDENCE)
    axes.plot(x, mean, color=colour, linestyle=style, linewidth=1.4)
    axes.fill_between(x, low, high, color=colour, alpha=0.3, linewidth=0)


def _shade_seen(axes: Axes, findings: Findings) -> None:
    seen = _states()[findings.where.seen]
    view_rad = findings.learner.config.env.field_of_view_rad
    axes.axvspan(seen[0], seen[-1], color="0.92", zorder=0)
    edges, heights = [-view_rad, view_rad], axes.get_xaxis_transform()
    axes.vlines(edges, 0, 1, colors=GREY, linewidth=0.8, linestyles=":", transform=heights)
    axes.set_xlim(_states()[0], _states()[-1])


def _states() -> NDArray[np.float64]:
    states: NDArray[np.float64] = STATES.double().numpy()
    return states


def _runs(by_kind: ByKind) -> str:
    return count_words([findings.learner.runs for findings in by_kind.values()])
