"""A figure of measures against one setting, with a line for each value of another setting."""

from collections.abc import Sequence
from itertools import cycle, product

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure
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

from .outliers import CUT_OFF, Limits, limits, mark_below

_PANEL_IN, _HEIGHT_IN, _TICK_IN = 4.6, 4.2, 0.55
INTERVAL = f"{100 * CONFIDENCE:g} % bootstrap interval"


def lines_figure(
    experiment: Experiment, x: str, lines: str, measures: Sequence[str], panels: str | None = None
) -> Figure:
    """Draw a panel for each measure: lines of its mean over the runs, with bands.

    Args:
        experiment: the experiment, which has a job for each combination of the keys' values.
        x: the key on the horizontal axis.
        lines: the key whose values have a line each.
        measures: names in :data:`fnnq_torchrl.studies.measures.MEASURES`.
        panels: a key whose values have separate panels.

    Raises:
        NoResults: if a combination is missing.
    """
    names = " and ".join(MEASURES[name].words.partition(" (")[0] for name in measures)
    over = count_words([experiment.runs])
    parts = [experiment]
    if panels:
        parts = [experiment.where(panels, value) for value in experiment.values(panels)]
    drawn = [(part, name, means(part, x, lines, name)) for part, name in product(parts, measures)]
    one_scale = len(measures) == 1
    ranges = [limits(*found) for *_, found in drawn]
    if one_scale:
        ranges = [limits(*np.concatenate([found for *_, found in drawn], axis=1))] * len(drawn)
    cut_off = any(
        (found[0] < shown.low).any() for (*_, found), shown in zip(drawn, ranges, strict=True)
    )
    panel_in = max(_PANEL_IN, _TICK_IN * len(experiment.values(x)))
    figure = new_figure(
        1 + panel_in * len(drawn),
        _HEIGHT_IN,
        f"{names.capitalize()} against {key_words(x)}, {over} each",
        f"line: mean over {over}; band: its {INTERVAL}" + (f"; {CUT_OFF}" if cut_off else ""),
    )
    row = figure.subplots(1, len(drawn), sharey=one_scale, squeeze=False)[0]
    for axes, (part, name, found), shown in zip(row, drawn, ranges, strict=True):
        draw_lines(axes, part, x, name, found, shown)
        if panels:
            axes.set_title(setting_words(panels, part.values(panels)[0]), fontsize=10)
    figure.draw_without_rendering()
    for axes in row:
        label_ends(axes, [setting_words(lines, value) for value in experiment.values(lines)])
    return figure


def means(experiment: Experiment, x: str, lines: str, measure: str) -> NDArray[np.float64]:
    """Return a measure's means over the runs, and the bounds of their intervals.

    Returns:
        The mean and both bounds, ``[3, lines, values of x]``, with x rising.

    Raises:
        NoResults: if a combination of the two keys' values is missing.
    """
    jobs = [
        [experiment.job_with({x: value, lines: line}) for value in sorted(experiment.values(x))]
        for line in experiment.values(lines)
    ]
    of = MEASURES[measure].of
    intervals = [
        [bootstrap_interval(np.mean, of(job.evaluations)) for job in along] for along in jobs
    ]
    return np.moveaxis(np.array(intervals), -1, 0)


def draw_lines(
    axes: Axes,
    experiment: Experiment,
    x: str,
    measure: str,
    found: NDArray[np.float64],
    shown: Limits,
) -> None:
    """Draw one panel of :func:`lines_figure`, without the labels of its lines.

    Args:
        axes: the panel.
        experiment: the panel's jobs.
        x: the key on the horizontal axis.
        measure: the name of the measure.
        found: the means and bounds from :func:`means`.
        shown: the limits of the vertical axis; a value below them becomes a mark at the edge.
    """
    values = sorted(experiment.values(x))
    steps = np.diff(values)
    # Unevenly spaced values would crowd, so they are drawn at even distances; the ticks name them.
    even = np.allclose(steps, steps[0]) if len(values) > 1 else True
    places = np.array(values) if even else np.arange(len(values))
    for (mean, low, high), (colour, style) in zip(
        np.moveaxis(found, 1, 0), cycle(LINES), strict=False
    ):
        inside = mean >= shown.low
        # The label stands at the end of the line, so the line ends at its last visible point.
        upto = np.flatnonzero(inside)[-1] + 1
        line = np.where(inside, mean, np.nan)[:upto]
        axes.plot(places[:upto], line, style, color=colour, linewidth=1.4, marker="o", ms=3.5)
        axes.fill_between(
            places, low, high, where=inside.tolist(), color=colour, alpha=0.3, linewidth=0
        )
        for place, value in zip(places[~inside], mean[~inside], strict=True):
            mark_below(axes, place, value, colour)
    margin = 0.03 * (places[-1] - places[0]) or 1
    axes.set_xlim(places[0] - margin, places[-1] + margin)
    axes.set_xticks(places, labels=[value_words(value) for value in values])
    axes.set_xlabel(key_words(x))
    axes.set_ylabel(MEASURES[measure].words)
    axes.set_ylim(*shown)
    quiet_grid(axes)
