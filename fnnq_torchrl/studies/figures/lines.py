"""A measure of the runs against one setting, with a line for each value of another."""

from collections.abc import Sequence
from itertools import cycle, product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import bootstrap_interval
from fnnq_torchrl.training.pictures.style import (
    LINES,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.pictures.words import key_words, setting_words, value_words
from fnnq_torchrl.training.results import CONFIDENCE

_PANEL_IN, _HEIGHT_IN, _TICK_IN = 4.6, 4.2, 0.55
INTERVAL = f"{100 * CONFIDENCE:g} % bootstrap interval"


def lines_figure(
    experiment: Experiment, x: str, lines: str, measures: Sequence[str], panels: str | None = None
) -> Figure:
    """Draw a panel for each measure, its mean over the runs with a band.

    Args:
        experiment: has a job for each combination of the keys.
        x: the key along the axis.
        lines: the key of which each value has a line.
        measures: of :data:`fnnq_torchrl.studies.measures.MEASURES`.
        panels: a key of which each value has panels of its own.

    Raises:
        NoResults: a combination is missing.
    """
    names = " and ".join(MEASURES[name].words.partition(" (")[0] for name in measures)
    over = count_words([experiment.runs])
    parts = [experiment]
    if panels:
        parts = [experiment.where(panels, value) for value in experiment.values(panels)]
    panel_in = max(_PANEL_IN, _TICK_IN * len(experiment.values(x)))
    figure = new_figure(
        1 + panel_in * len(measures) * len(parts),
        _HEIGHT_IN,
        f"{names.capitalize()} against {key_words(x)}, {over} each",
        f"line: mean over {over}; band: its {INTERVAL}",
    )
    one_scale = len(measures) == 1
    row = figure.subplots(1, len(measures) * len(parts), sharey=one_scale, squeeze=False)[0]
    for axes, (part, name) in zip(row, product(parts, measures), strict=True):
        draw_lines(axes, part, x, lines, name)
        if panels:
            axes.set_title(setting_words(panels, part.values(panels)[0]), fontsize=10)
    figure.draw_without_rendering()
    for axes in row:
        label_ends(axes, [setting_words(lines, value) for value in experiment.values(lines)])
    return figure


def draw_lines(axes: Axes, experiment: Experiment, x: str, lines: str, measure: str) -> None:
    """One panel of :func:`lines_figure`, still without the words beside its lines."""
    values = sorted(experiment.values(x))
    steps = np.diff(values)
    # Unevenly spaced values would crowd somewhere: they have even places, and their ticks say so.
    even = np.allclose(steps, steps[0]) if len(values) > 1 else True
    places = np.array(values) if even else np.arange(len(values))
    top = 0.0
    for line, (colour, style) in zip(experiment.values(lines), cycle(LINES), strict=False):
        jobs = [experiment.job_with({x: value, lines: line}) for value in values]
        scores = [MEASURES[measure].of(job.evaluations) for job in jobs]
        mean, low, high = np.transpose([bootstrap_interval(np.mean, s) for s in scores])
        top = max(top, np.nanmax([mean, high]))
        axes.plot(places, mean, color=colour, linestyle=style, linewidth=1.4, marker="o", ms=3.5)
        axes.fill_between(places, low, high, color=colour, alpha=0.3, linewidth=0)
    margin = 0.03 * (places[-1] - places[0]) or 1
    axes.set_xlim(places[0] - margin, places[-1] + margin)
    axes.set_xticks(places, labels=[value_words(value) for value in values])
    axes.set_xlabel(key_words(x))
    axes.set_ylabel(MEASURES[measure].words)
    axes.set_ylim(0, max(1.05 * top or 1, axes.get_ylim()[1]))  # another panel may share it
    quiet_grid(axes)
