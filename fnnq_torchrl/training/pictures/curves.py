"""Learning curves: the score against the learning situations."""

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from fnnq_torchrl.training.intervals import MeanInterval, mean_interval
from fnnq_torchrl.training.results import CONFIDENCE, Evaluations, best_first, read_evaluations

from .style import (
    LABEL_PITCH_PT,
    LABEL_PT,
    LINES,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
    save,
)
from .words import setting_words

_WIDTH_IN, _HEIGHT_IN = 7.0, 4.2
_SHORT_LABEL = 10  # letters that a picture of the usual width has room for
_MOST_LABELS = 20  # more lines and bands can't be told apart


_MEASURES = {
    "successes": "score (catches)",
    "return": "return, mean over the test's episodes",
    "length": "steps of an episode, mean over the test's",
}


def learning_curve(
    evaluations_csv: Path, picture: Path, best: int | None = None, measure: str = "successes"
) -> None:
    """Draw the mean score against the learning situations: a curve and a band for each λ.

    Args:
        evaluations_csv: the result file, the only source of what is drawn.
        picture: the file to write, atomically; its suffix (.png, .svg, .pdf) is its format.
        best: the highest possible score of a test that counts successes; the highest in the file
            if not given.
        measure: what the score is (:attr:`envs.core.world.WorldConfig.measure`).

    Raises:
        OSError: a file cannot be read or written.
        ValueError: the result file is foreign or damaged, or the format is unknown.
    """
    save(learning_curve_figure(read_evaluations(evaluations_csv, measure), best), picture)


def learning_curve_figure(evaluations: Evaluations, best: int | None = None) -> Figure:
    """Draw what :func:`learning_curve` writes, with its ``best``."""
    curves = [
        Curve(
            setting_words("lam", float(lam)),
            evaluations.situations,
            evaluations.score[evaluations.lam == lam],
            int(evaluations.diverged[evaluations.lam == lam, -1].sum()),
        )
        for lam in np.unique(evaluations.lam)
    ]
    return curves_figure(curves, "values of λ", best, evaluations.measure)


class Curve(NamedTuple):
    """The runs of one configuration."""

    name: str
    situations: NDArray[np.int64]  # [evaluations], learning situations before each
    scores: NDArray[Any]  # [runs, evaluations]
    diverged: int  # runs; from then on they have the worst score there is

    @property
    def label(self) -> str:
        """The name and, if there are any, how many runs have diverged."""
        return f"{self.name} ({self.diverged:,} diverged)" if self.diverged else self.name

    @property
    def mean_score(self) -> NDArray[np.float64]:
        """Of each run after learning began, ``[runs]``."""
        return self.scores[:, 1:].mean(axis=1)


def sweep_curves(
    curves: Sequence[Curve], of: str, picture: Path, best: int | None, measure: str = "successes"
) -> None:
    """Draw the mean score of a sweep's configurations, a curve and a band for each.

    Args:
        curves: in their order; at least one.
        of: what there is one curve for each of, in the plural.
        picture: the file to write, atomically; its suffix is its format.
        best, measure: as in :func:`curves_figure`.

    Raises:
        OSError: the file cannot be written.
        ValueError: the format is unknown.
    """
    save(curves_figure(curves, of, best, measure), picture)


def curves_figure(
    curves: Sequence[Curve], of: str, best: int | None = None, measure: str = "successes"
) -> Figure:
    """Draw curves and bands, each with its label at its end.

    Of more than can be told apart, the best have colours and labels, and the others are grey.

    Args:
        curves: in their order; at least one.
        of: what there is one curve for each of, in the plural.
        best: the highest possible score; the highest among the curves if not given.
        measure: what the score is (:attr:`envs.core.world.WorldConfig.measure`).
    """
    by_score = best_first([curve.mean_score for curve in curves], measure)
    labelled = [curves[i] for i in sorted(by_score[:_MOST_LABELS])]
    others = [curves[i] for i in by_score[_MOST_LABELS:]]
    intervals = [mean_interval(curve.scores, confidence=CONFIDENCE) for curve in labelled]
    # Tall enough for all labels, one above the other; wide enough for the longest.
    height_in = max(_HEIGHT_IN, 1.6 + len(labelled) * LABEL_PITCH_PT / 72)
    longest = max(len(curve.label) for curve in labelled)
    width_in = _WIDTH_IN + max(0, longest - _SHORT_LABEL) * 0.6 * LABEL_PT / 72
    title, caption = _titles(curves, of, intervals)
    if others:
        caption += f"\ngrey: the other {len(others):,}, which scored worse"
    figure = new_figure(width_in, height_in, title, caption)
    axes = figure.add_subplot()
    _set_score_axis(axes, measure, best, max(int(curve.scores.max()) for curve in curves))
    _set_situations_axes(axes, max((curve.situations for curve in curves), key=lambda s: s[-1]))
    for curve, (mean, low, high), (colour, style) in zip(
        labelled, intervals, cycle(LINES), strict=False
    ):
        axes.plot(curve.situations, mean, color=colour, linestyle=style, linewidth=1.4)
        axes.fill_between(curve.situations, low, high, color=colour, alpha=0.3, linewidth=0)
    for curve in others:
        # Not one of the axes' lines, each of which has a label.
        points = np.stack([curve.situations, curve.scores.mean(axis=0)], axis=1)
        axes.add_collection(LineCollection([points], color="0.85", linewidth=0.8, zorder=1.5))
    figure.draw_without_rendering()  # lays out, which gives the axes their height
    label_ends(axes, [curve.label for curve in labelled])
    return figure


def _titles(curves: Sequence[Curve], of: str, intervals: Sequence[MeanInterval]) -> tuple[str, str]:
    """Say what the picture shows, and what its lines and bands are."""
    runs = [len(curve.scores) for curve in curves]
    over = count_words(runs)
    if len(curves) == 1:
        title = f"Learning curve for {curves[0].label}, {over}"
    else:
        title = f"Learning curves for {len(curves):,} {of}, {over} each"
    if max(runs) == 1:
        return title, "line: a single run, which has no confidence interval"
    # In figures too, since over many runs the band is too narrow to be seen.
    widest = np.nanmax([np.nanmax(interval.high - interval.low) for interval in intervals]) / 2
    return title, (
        f"line: mean over {over}; band: its {100 * CONFIDENCE:g} % confidence interval "
        f"(Student's t), at most ±{widest:.2g}"
    )


def _set_score_axis(axes: Axes, measure: str, best: int | None, highest_seen: int) -> None:
    words = _MEASURES[measure]
    axes.set_ylabel(words if best is None else f"score (catches of {best})")
    quiet_grid(axes)
    if measure == "successes":
        # A little above the highest, so that the frame hides no curve that stays there.
        axes.set_ylim(0, 1.02 * (best or max(highest_seen, 1)))
        axes.yaxis.set_major_locator(MaxNLocator(integer=True))


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
