"""The common style of all pictures: colours, labels beside lines, titles and files."""

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure, rc_context
from fnnq_torchrl.files.atomic import atomic_write

# Okabe and Ito's colours for colour-blind readers, without the yellow, which is too pale.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# All colours with solid lines, then all colours with the next line style, and so on.
LINES = [(colour, style) for style, colour in product(("-", "--", ":", "-."), COLOURS)]
GREY = "0.35"
LABEL_PT = 9.0
LABEL_PITCH_PT = 1.35 * LABEL_PT
"""The least distance between the middles of two labels, in points."""

_DPI = 160


def new_figure(width_in: float, height_in: float, title: str, caption: str) -> Figure:
    """Return an empty figure with its title above and its caption below."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    figure.suptitle(title, fontsize=12)
    figure.supxlabel(caption, fontsize=8.5, color=GREY)
    return figure


def save(figure: Figure, picture: Path) -> None:
    """Write a picture, atomically; the suffix (.png, .svg, .pdf) gives the format.

    PNG and SVG files of equal figures are equal, byte for byte.

    Raises:
        OSError: if the file can't be written.
        ValueError: if the format is unknown.
    """
    form = picture.suffix.removeprefix(".")
    undated = {"Date": None} if form == "svg" else None
    with rc_context({"svg.hashsalt": picture.stem}), atomic_write(picture) as file:
        figure.savefig(file, format=form, dpi=_DPI, metadata=undated)


def count_words(runs: Sequence[int] | NDArray[np.int64]) -> str:
    """Return numbers of runs in words: ``22 runs``, ``1 run``, ``21 to 22 runs``."""
    fewest, most = min(runs), max(runs)
    number = f"{most:,}" if fewest == most else f"{fewest:,} to {most:,}"
    return f"{number} run{'s' if most > 1 else ''}"


def quiet_grid(axes: Axes) -> None:
    """Draw grid lines behind everything else."""
    axes.grid(color="0.9")
    axes.set_axisbelow(True)


def label_ends(axes: Axes, labels: Sequence[str]) -> None:
    """Write each line's label to the right of its last point, and link the two.

    The figure must have been laid out before, so that the axes have their final height.
    """
    lasts = [np.asarray(line.get_xydata(), dtype=np.float64)[-1] for line in axes.lines]
    ends = [float(y) for _, y in lasts]
    to_axes = axes.transData + axes.transAxes.inverted()
    places = np.array([to_axes.transform((0.0, end))[1] for end in ends])  # in axes' heights
    left, right = axes.get_xlim()
    height_pt = axes.get_window_extent().height * 72 / axes.figure.dpi
    heights = spread(places, LABEL_PITCH_PT / height_pt, 0, 1)
    for line, label, (x, y), height in zip(axes.lines, labels, lasts, heights, strict=True):
        link = {"arrowstyle": "-", "color": line.get_color(), "relpos": (0.0, 0.5), "shrinkB": 0}
        axes.annotate(
            label,
            xy=((x - left) / (right - left), y),
            xytext=(1.03, height),
            xycoords=axes.get_yaxis_transform(),  # x in axes' widths, y as data
            textcoords="axes fraction",
            fontsize=LABEL_PT,
            color=line.get_color(),
            verticalalignment="center",
            annotation_clip=False,
            arrowprops=link,
        )


def spread(
    heights: NDArray[np.float64], gap: float, low: float, high: float
) -> NDArray[np.float64]:
    """Move heights as little as possible (least squares) until all are at least ``gap`` apart.

    Args:
        heights: the wanted heights, ``[n]``, in any order; the moved heights have the same order.
        gap: the least distance between two neighbours.
        low: the lower bound of the moved heights.
        high: the upper bound of the moved heights, at least n − 1 gaps above ``low``.

    Returns:
        The moved heights, ``[n]``.
    """
    order = np.argsort(heights, kind="stable")
    room = gap * np.arange(heights.size)
    moved = heights[order] - room
    # Without the gaps below each, the heights must only be non-decreasing: isotonic regression.
    if np.any(np.diff(moved) < 0):
        from scipy.optimize import isotonic_regression  # here, since importing it is slow

        moved = isotonic_regression(moved).x
    result = np.empty_like(moved)
    result[order] = np.clip(moved, low, high - room[-1]) + room
    return result
