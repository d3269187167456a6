"""Learning curves: the score against the learning situations."""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fnnq_torchrl.experiments import Experiment
from fnnq_torchrl.results import CONFIDENCE, Evaluations, read_evaluations
from fnnq_torchrl.stats import MeanInterval, mean_interval

from .style import LABEL_PITCH_PT, LINES, count_words, label_ends, new_figure, quiet_grid, save
from .words import key_words, setting_words

_WIDTH_IN, _HEIGHT_IN = 7.0, 4.2
_Catches = NDArray[np.int64]


def learning_curve(evaluations_csv: Path, picture: Path, best: int | None = None) -> None:
    """Draw the mean score against the learning situations: a curve and a band for each λ.

    Args:
        evaluations_csv: the result file, the only source of what is drawn.
        picture: the file to write, atomically; its suffix (.png, .svg, .pdf) is its format.
        best: the highest possible score, which is the number of evaluation situations; the
            highest in the file if not given.

    Raises:
        OSError: a file cannot be read or written.
        ValueError: the result file is foreign or damaged, or the format is unknown.
    """
    save(learning_curve_figure(read_evaluations(evaluations_csv), best), picture)


def learning_curve_figure(evaluations: Evaluations, best: int | None = None) -> Figure:
    """Draw what :func:`learning_curve` writes, with its ``best``."""
    lams = np.unique(evaluations.lam)
    catches = [evaluations.catches[evaluations.lam == lam] for lam in lams]
    labels = [setting_words("lam", float(lam)) for lam in lams]
    return _curves_figure(evaluations.situations, catches, labels, "λ", best)


def experiment_curves_figure(experiment: Experiment, key: str) -> Figure:
    """Draw a curve and a band for each job of an experiment that varies one key."""
    catches = [job.evaluations.catches for job in experiment.jobs]
    labels = [setting_words(key, job.settings[key]) for job in experiment.jobs]
    first = experiment.jobs[0]
    return _curves_figure(first.evaluations.situations, catches, labels, key_words(key), first.best)


def _curves_figure(
    situations: NDArray[np.int64],
    catches: Sequence[_Catches],
    labels: Sequence[str],
    varied: str,
    best: int | None,
) -> Figure:
    curves = [mean_interval(scores, confidence=CONFIDENCE) for scores in catches]
    title, caption = _titles([len(scores) for scores in catches], labels, varied, curves)
    # Tall enough for all labels, one above the other.
    height_in = max(_HEIGHT_IN, 1.6 + len(curves) * LABEL_PITCH_PT / 72)
    figure = new_figure(_WIDTH_IN, height_in, title, caption)

    axes = figure.add_subplot()
    _set_score_axis(axes, best, highest_seen=max(int(scores.max()) for scores in catches))
    _set_situations_axes(axes, situations)
    for (mean, low, high), (colour, style) in zip(curves, cycle(LINES), strict=False):
        axes.plot(situations, mean, color=colour, linestyle=style, linewidth=1.4)
        axes.fill_between(situations, low, high, color=colour, alpha=0.3, linewidth=0)
    figure.draw_without_rendering()
    label_ends(axes, labels)
    return figure


def _titles(
    runs: Sequence[int], labels: Sequence[str], varied: str, curves: Sequence[MeanInterval]
) -> tuple[str, str]:
    """Say what the picture shows, and what its lines and bands are.

    Args:
        runs: the number of runs in each curve.
        labels: what each curve is.
        varied: what differs between them.
        curves: their means and bands.

    Returns:
        The title and the caption.
    """
    over = count_words(runs)
    if len(labels) == 1:
        title = f"Learning curve for {labels[0]}, {over}"
    else:
        title = f"Learning curves for {len(labels)} values of {varied}, {over} each"
    if max(runs) == 1:
        return title, "line: a single run, which has no confidence interval"
    # In figures too, since over many runs the band is too narrow to be seen.
    widest = np.nanmax([curve.high - curve.low for curve in curves]) / 2
    return title, (
        f"line: mean over {over}; band: its {100 * CONFIDENCE:g} % confidence interval "
        f"(Student's t), at most ±{widest:.2g}"
    )


def _set_score_axis(axes: Axes, best: int | None, highest_seen: int) -> None:
    # A little above the highest, lest the frame hide a curve that stays there.
    axes.set_ylim(0, 1.02 * (best or max(highest_seen, 1)))
    axes.set_ylabel("score (catches)" if best is None else f"score (catches of {best})")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    quiet_grid(axes)


def _set_situations_axes(axes: Axes, situations: NDArray[np.int64]) -> None:
    """Count the learning situations below and, as the paper does, the evaluations above."""
    axes.set_xlim(0, situations[-1])
    axes.set_xlabel("learning situations")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))

    locator = MaxNLocator(nbins=10, steps=[1, 2, 5, 10], integer=True)
    ticks = np.array(locator.tick_values(0, situations.size - 1), dtype=int)
    ticks = ticks[ticks < situations.size]
    above = axes.secondary_xaxis("top")
    above.set_xticks(situations[ticks], labels=[str(tick) for tick in ticks])
    above.set_xlabel("evaluations")
