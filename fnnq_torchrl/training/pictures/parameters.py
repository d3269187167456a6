"""Draws the course of the learning parameters beside the learning curve."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure, MaxNLocator, own_style
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.results import CONFIDENCE, PARAMETERS, Evaluations
from fnnq_torchrl.training.score import Score

from .style import COLOURS, count_words, new_figure, quiet_grid, save
from .words import key_words

_BAND = (5, 95)
"""The percentiles between which the band of a parameter lies."""

_PANEL_IN = (2.7, 2.6)


@own_style()
def parameters_picture(evaluations: Evaluations, picture: Path, score: Score) -> None:
    """Draw a job's learning curve and, beside it, the course of its learning parameters.

    Args:
        evaluations: the scores and parameters of the job's runs.
        picture: the file to write, atomically; its suffix (.png, .svg, .pdf) gives the format.
        score: the name and the bounds of the job's score.

    Raises:
        OSError: if the file can't be written.
        ValueError: if the format is unknown.
    """
    save(parameters_figure(evaluations, score), picture)


def parameters_figure(evaluations: Evaluations, score: Score, title: str = "") -> Figure:
    """Return the figure that :func:`parameters_picture` writes, with another title if given."""
    courses = {
        key: course for key in PARAMETERS if not np.isnan(course := evaluations.column(key)).all()
    }
    over = count_words([evaluations.runs])
    caption = (
        f"score: mean over {over} and its {100 * CONFIDENCE:g} % confidence interval; "
        f"parameters: median over the runs, and the middle {_BAND[1] - _BAND[0]} %"
    )
    panels = 1 + len(courses)
    figure = new_figure(
        panels * _PANEL_IN[0], _PANEL_IN[1], title or f"Learning parameters, {over}", caption
    )
    first, *others = figure.subplots(1, panels, squeeze=False, sharex=True).flatten()
    situations = evaluations.situations
    mean, low, high = mean_interval(evaluations.score, confidence=CONFIDENCE, bounds=score.bounds)
    _draw(first, situations, mean, low, high, COLOURS[0])
    first.set_ylabel(score.words)
    for axes, (key, course), colour in zip(others, courses.items(), COLOURS[1:], strict=False):
        low, middle, high = np.nanpercentile(course, (_BAND[0], 50, _BAND[1]), axis=0)
        _draw(axes, situations, middle, low, high, colour)
        axes.set_ylabel(key_words(key))
        if key != "gamma" and (course > 0).all():
            axes.set_yscale("log")
    return figure


def _draw(
    axes: Axes,
    situations: NDArray[np.int64],
    middle: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    colour: str,
) -> None:
    quiet_grid(axes)
    axes.plot(situations, middle, color=colour, linewidth=1.4)
    axes.fill_between(situations, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.set_xlim(0, situations[-1])
    axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.set_xlabel("learning situations")
