"""Draws learning curves: the score against the number of learning situations."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure, LineCollection, MaxNLocator, own_style
from fnnq_torchrl.training.intervals import MeanInterval, mean_interval
from fnnq_torchrl.training.results import CONFIDENCE, Evaluations, best_first
from fnnq_torchrl.training.score import Score

from .curve import Curve
from .style import (
    COLOURS,
    LABEL_PITCH_PT,
    LABEL_PT,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
    save,
)
from .words import setting_words

_WIDTH_IN, _HEIGHT_IN = 7.0, 4.2
_SHORT_LABEL = 10  # letters for which a picture of the usual width has room

_MOST_PANELS = 20
_COLUMNS = 4
_PANEL_IN = (2.4, 1.8)
_TITLE_PT = 8.0
_TITLE_LETTERS = 32  # letters in a line as wide as a panel


@own_style()
def learning_curve(evaluations: Evaluations, picture: Path, score: Score) -> None:
    """Draw a job's learning curve: the mean score and its confidence band, for each λ.

    Args:
        evaluations: the scores of the job's runs.
        picture: the file to write, atomically; its suffix (.png, .svg, .pdf) gives the format.
        score: the name and the bounds of the job's score.

    Raises:
        OSError: if the file can't be written.
        ValueError: if the format is unknown.
    """
    save(learning_curve_figure(evaluations, score), picture)


def learning_curve_figure(evaluations: Evaluations, score: Score) -> Figure:
    """Return the figure that :func:`learning_curve` writes."""
    curves = [
        Curve(
            setting_words("lam", float(lam)),
            evaluations.situations,
            evaluations.score[evaluations.lam == lam],
            int(evaluations.diverged[evaluations.lam == lam, -1].sum()),
        )
        for lam in np.unique(evaluations.lam)
    ]
    return curves_figure(curves, "values of λ", score)


@own_style()
def sweep_curves(curves: Sequence[Curve], of: str, picture: Path, score: Score) -> None:
    """Draw the mean score of each configuration of a sweep, with its confidence band.

    Args:
        curves, of, score: as in :func:`curves_figure`.
        picture: the file to write, atomically; its suffix gives the format.

    Raises:
        OSError: if the file can't be written.
        ValueError: if the format is unknown.
    """
    save(curves_figure(curves, of, score), picture)


def curves_figure(curves: Sequence[Curve], of: str, score: Score) -> Figure:
    """Return a figure with a curve and a confidence band for each configuration.

    Up to seven curves (`COLOURS`) share one plot, each with its label at its end. With more, each
    curve has a panel, which shows all other curves in grey. With more than `_MOST_PANELS`, only the
    best curves have a panel.

    Args:
        curves: the curves in their order, at least one.
        of: the plural noun for what differs between the curves, such as ``values of λ``.
        score: the score of all curves.
    """
    draw = _together if len(curves) <= len(COLOURS) else _in_panels
    return draw(curves, of, score)


def _together(curves: Sequence[Curve], of: str, score: Score) -> Figure:
    intervals = _intervals(curves, score)
    # Tall enough for all labels, one above the other; wide enough for the longest label.
    height_in = max(_HEIGHT_IN, 1.6 + len(curves) * LABEL_PITCH_PT / 72)
    longest = max(len(curve.label) for curve in curves)
    width_in = _WIDTH_IN + max(0, longest - _SHORT_LABEL) * 0.6 * LABEL_PT / 72
    figure = new_figure(width_in, height_in, _title(curves, of), _caption(curves, intervals))
    axes = figure.add_subplot()
    axes.set_ylabel(score.words)
    axes.set_xlabel("learning situations")
    _set_ranges(axes, curves, score)
    _count_evaluations(axes, _longest(curves))
    for curve, interval, colour in zip(curves, intervals, COLOURS, strict=False):
        _draw(axes, curve, interval, colour)
    if len(curves) > 1:  # a single label has no neighbour
        figure.draw_without_rendering()  # the layout gives the axes their height
    label_ends(axes, [curve.label for curve in curves])
    return figure


def _in_panels(curves: Sequence[Curve], of: str, score: Score) -> Figure:
    by_score = best_first([curve.mean_score for curve in curves], score.measure)
    shown = [curves[place] for place in sorted(by_score[:_MOST_PANELS])]
    intervals = _intervals(shown, score)
    rows = -(-len(shown) // _COLUMNS)
    titles = [
        "\n".join(line for text in curve.words for line in textwrap.wrap(text, _TITLE_LETTERS))
        for curve in shown
    ]
    lines = max(title.count("\n") for title in titles)  # extra lines, beyond the first
    height_in = rows * (_PANEL_IN[1] + lines * 1.2 * _TITLE_PT / 72) + 1.0
    caption = f"{_caption(curves, intervals)}; grey: all others"
    title = _title(curves, of)
    if len(shown) < len(curves):
        title += f": the best {len(shown)}"
    figure = new_figure(_COLUMNS * _PANEL_IN[0], height_in, title, caption)
    figure.supylabel(score.words, fontsize="medium")
    panels = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True).flatten()
    _set_ranges(panels[0], curves, score, ticks=4)
    lines_of_all = [
        np.stack([curve.situations, curve.scores.mean(axis=0)], axis=1) for curve in curves
    ]
    for place, axes in enumerate(panels):
        if place >= len(shown):
            axes.set_visible(False)
            continue
        quiet_grid(axes)
        axes.add_collection(LineCollection(lines_of_all, color="0.85", linewidth=0.6, zorder=0.9))
        _draw(axes, shown[place], intervals[place], COLOURS[0])
        axes.set_title(titles[place], fontsize=_TITLE_PT)
        axes.tick_params(labelsize=_TITLE_PT)
        if place + _COLUMNS >= len(shown):  # no panel below
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("learning situations", fontsize=_TITLE_PT)
    return figure


def _intervals(curves: Sequence[Curve], score: Score) -> list[MeanInterval]:
    return [
        mean_interval(curve.scores, confidence=CONFIDENCE, bounds=score.bounds) for curve in curves
    ]


def _draw(axes: Axes, curve: Curve, interval: MeanInterval, colour: str) -> None:
    mean, low, high = interval
    axes.plot(curve.situations, mean, color=colour, linewidth=1.4)
    axes.fill_between(curve.situations, low, high, color=colour, alpha=0.2, linewidth=0)


def _title(curves: Sequence[Curve], of: str) -> str:
    over = count_words([len(curve.scores) for curve in curves])
    if len(curves) == 1:
        return f"Learning curve for {curves[0].label}, {over}"
    return f"Learning curves for {len(curves):,} {of}, {over} each"


def _caption(curves: Sequence[Curve], intervals: Sequence[MeanInterval]) -> str:
    """Return the caption, which explains the lines and the bands."""
    widths = np.concatenate([interval.high - interval.low for interval in intervals])
    if np.isnan(widths).all():
        return "line: a single run, which has no confidence interval"
    # The width is stated, since over many runs the band is too narrow to see.
    return (
        f"line: mean over {count_words([len(curve.scores) for curve in curves])}; band: its "
        f"{100 * CONFIDENCE:g} % confidence interval (Student's t), at most "
        f"{np.nanmax(widths):.2g} wide"
    )


def _longest(curves: Sequence[Curve]) -> NDArray[np.int64]:
    return max((curve.situations for curve in curves), key=lambda situations: situations[-1])


def _set_ranges(axes: Axes, curves: Sequence[Curve], score: Score, ticks: int = 10) -> None:
    """Set the ranges of the axes; a score of successes begins at 0 and includes the highest."""
    quiet_grid(axes)
    axes.set_xlim(0, _longest(curves)[-1])
    axes.xaxis.set_major_locator(MaxNLocator(ticks, integer=True))
    if score.measure == "successes":
        highest_seen = max(int(curve.scores.max()) for curve in curves)
        highest = score.high if np.isfinite(score.high) else max(highest_seen, 1)
        axes.set_ylim(0, 1.02 * highest)  # the frame doesn't hide a curve at the highest score
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))


def _count_evaluations(axes: Axes, situations: NDArray[np.int64]) -> None:
    """Add an upper axis with the numbers of the evaluations, as in the paper's figures."""
    locator = MaxNLocator(nbins=10, steps=[1, 2, 5, 10], integer=True)
    ticks = np.array(locator.tick_values(0, situations.size - 1), dtype=int)
    ticks = ticks[ticks < situations.size]
    above = axes.secondary_xaxis("top")
    above.set_xticks(situations[ticks], labels=[str(tick) for tick in ticks])
    above.set_xlabel("evaluations")
