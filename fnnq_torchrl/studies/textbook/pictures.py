"""The pictures of the page: our curves, and the published points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure, own_style
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import (
    LINES,
    count_words,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.results import CONFIDENCE

from .published import STEPS, TILINGS
from .returns import NAME
from .walk import Errors

_SHOWN = 300
"""The largest number of steps an episode in the figure, as in the book."""

_BAND = f"band: its {100 * CONFIDENCE:g} % interval"


@own_style()
def car_figure(experiment: Experiment) -> Figure:
    """Draw the steps an episode against α · 8, a line for each λ, and the published best points."""
    runs = count_words([experiment.runs])
    figure = new_figure(
        7.5,
        4.6,
        "Mountain Car by Sarsa(λ): steps an episode, first 50 episodes",
        f"line: mean over {runs}; {_BAND}; ring: best published point, 30 runs",
    )
    axes = figure.subplots()
    lams = sorted(experiment.values("lam"))
    for lam, (colour, style) in zip(lams, LINES, strict=False):
        jobs = sorted(experiment.where("lam", lam).jobs, key=lambda job: job.settings["alpha"])
        places = [job.settings["alpha"] * TILINGS for job in jobs]
        _draw(axes, lam, places, [job.evaluations.lengths[:, -1] for job in jobs], colour, style)
        if point := STEPS.get(lam):
            axes.scatter(point.at, point.value, s=80, facecolor="none", edgecolor=colour, zorder=5)
    axes.set_ylim(160, _SHOWN)
    axes.set_xlabel("α · 8 tilings")
    axes.set_ylabel("steps an episode")
    quiet_grid(axes)
    axes.legend(frameon=False)
    return figure


@own_style()
def walk_figure(errors: Sequence[Errors]) -> Figure:
    """Draw the errors against α, a panel for each trace or algorithm and a line for each λ."""
    runs = count_words([min(len(each.errors) for each in errors)])
    traces = sorted(dict.fromkeys(each.trace for each in errors), key=lambda name: name != NAME)
    figure = new_figure(
        1 + 4.6 * len(traces),
        4.6,
        "Random walk by TD(λ): error of 19 values, first 10 episodes",
        f"line: mean over {runs}; {_BAND}",
    )
    row = figure.subplots(1, len(traces), sharey=True, squeeze=False)[0]
    lams = sorted({each.lam for each in errors})
    names = {"gradient": "accumulating traces", "dutch": "dutch traces (true online)"}
    for axes, trace in zip(row, traces, strict=True):
        for lam, (colour, style) in zip(lams, LINES, strict=False):
            line = sorted(
                (each for each in errors if (each.trace, each.lam) == (trace, lam)),
                key=lambda each: each.alpha,
            )
            _draw(
                axes,
                lam,
                [each.alpha for each in line],
                [each.errors for each in line],
                colour,
                style,
            )
        axes.set_title(names.get(trace, trace), fontsize=10)
        axes.set_ylim(0.2, 0.56)
        axes.set_xlabel("α")
        quiet_grid(axes)
    row[-1].legend(frameon=False)  # the same lines as in the other panels, where it would hide some
    row[0].set_ylabel("root mean square error")
    return figure


def _draw(
    axes: Axes,
    lam: float,
    places: Sequence[float],
    samples: Sequence[NDArray[np.float64]],
    colour: str,
    style: str,
) -> None:
    found = [mean_interval(sample) for sample in samples]
    axes.plot(places, [each.mean for each in found], style, color=colour, label=f"λ = {lam:g}")
    lows, highs = [each.low for each in found], [each.high for each in found]
    axes.fill_between(places, lows, highs, color=colour, alpha=0.2, linewidth=0)
