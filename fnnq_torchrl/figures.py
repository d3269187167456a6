"""Pictures, drawn from result files alone. The only module that imports matplotlib."""

from itertools import cycle, product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from fnnq_torchrl.atomic import atomic_write
from fnnq_torchrl.results import CONFIDENCE, Evaluations, read_evaluations
from fnnq_torchrl.stats import MeanInterval, mean_interval

# Okabe and Ito's colours, safe for the colour-blind, but for the yellow, too pale on white.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# When the colours are used up, they come again with another line.
_LINES = [(colour, style) for style, colour in product(("-", "--", ":", "-."), _COLOURS)]
_WIDTH_IN, _HEIGHT_IN, _DPI = 7.0, 4.2, 160
_LABEL_PT = 9.0
_LABEL_PITCH_PT = 1.35 * _LABEL_PT  # from one label's middle to the next one's, at least


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
    figure = learning_curve_figure(read_evaluations(evaluations_csv), best)
    with atomic_write(picture) as file:
        figure.savefig(file, format=picture.suffix.removeprefix("."), dpi=_DPI)


def learning_curve_figure(evaluations: Evaluations, best: int | None = None) -> Figure:
    """Draw what :func:`learning_curve` writes, with its ``best``."""
    lams, runs = np.unique(evaluations.lam, return_counts=True)
    curves = [
        mean_interval(evaluations.catches[evaluations.lam == lam], confidence=CONFIDENCE)
        for lam in lams
    ]
    # Tall enough for all labels, one above the other.
    height_in = max(_HEIGHT_IN, 1.6 + lams.size * _LABEL_PITCH_PT / 72)
    figure = Figure(figsize=(_WIDTH_IN, height_in), layout="constrained")
    title, caption = _titles(lams, runs, curves)
    figure.suptitle(title, fontsize=12)
    figure.supxlabel(caption, fontsize=8.5, color="0.35")

    axes = figure.add_subplot()
    _set_score_axis(axes, best, highest_seen=int(evaluations.catches.max()))
    _set_situations_axes(axes, evaluations.situations)
    for (mean, low, high), (colour, style) in zip(curves, cycle(_LINES), strict=False):
        axes.plot(evaluations.situations, mean, color=colour, linestyle=style, linewidth=1.4)
        axes.fill_between(evaluations.situations, low, high, color=colour, alpha=0.3, linewidth=0)
    figure.draw_without_rendering()  # lays out, which gives the axes their height
    _label_ends(axes, lams, ends=np.array([curve.mean[-1] for curve in curves]))
    return figure


def _titles(
    lams: NDArray[np.float64], runs: NDArray[np.int64], curves: list[MeanInterval]
) -> tuple[str, str]:
    """Say what the picture shows, and what its lines and bands are.

    Args:
        lams: the λ of each curve, ``[curves]``.
        runs: the number of runs in each, ``[curves]``.
        curves: their means and bands.

    Returns:
        The title and the caption.
    """
    most = runs.max()
    number = f"{most:,}" if runs.min() == most else f"{runs.min():,} to {most:,}"
    over = f"{number} run{'s' if most > 1 else ''}"
    if lams.size == 1:
        title = f"Learning curve for λ = {lams[0]:g}, {over}"
    else:
        title = f"Learning curves for {lams.size} values of λ, {over} each"
    if most == 1:
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
    axes.grid(color="0.9")
    axes.set_axisbelow(True)


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


def _label_ends(axes: Axes, lams: NDArray[np.float64], ends: NDArray[np.float64]) -> None:
    """Write each line's λ beside its last score, and link the two; both ``[lines]``."""
    low, high = axes.get_ylim()
    height_pt = axes.get_window_extent().height * 72 / axes.figure.dpi
    heights = spread(ends, _LABEL_PITCH_PT * (high - low) / height_pt, low, high)
    beside = axes.get_yaxis_transform()  # x in widths of the axes, y in scores
    for line, lam, end, height in zip(axes.lines, lams, ends, heights, strict=True):
        link = {"arrowstyle": "-", "color": line.get_color(), "relpos": (0.0, 0.5), "shrinkB": 0}
        axes.annotate(
            f"λ = {lam:g}",
            xy=(1.0, end),
            xytext=(1.03, height),
            xycoords=beside,
            textcoords=beside,
            fontsize=_LABEL_PT,
            color=line.get_color(),
            verticalalignment="center",
            annotation_clip=False,
            arrowprops=link,
        )


def spread(
    heights: NDArray[np.float64], gap: float, low: float, high: float
) -> NDArray[np.float64]:
    """Move heights as little as possible (least squares) until all are ``gap`` apart.

    Args:
        heights: where they would be, ``[n]``, in any order; their order is kept.
        gap: least distance of two neighbours.
        low: lower bound for the moved heights.
        high: upper bound for them, no less than n − 1 gaps above the lower.

    Returns:
        The moved heights, ``[n]``.
    """
    order = np.argsort(heights, kind="stable")
    room = gap * np.arange(heights.size)
    # Less the room that the ones below it need, each must only not fall: isotonic regression.
    moved = isotonic_regression(heights[order] - room).x
    result = np.empty_like(moved)
    result[order] = np.clip(moved, low, high - room[-1]) + room
    return result
