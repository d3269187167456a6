"""A figure of one or several panels, each of which shows the film of an episode."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from envs.pictures import Axes, Figure, FigureCanvasAgg, Patch, own_style

Image = NDArray[np.uint8]
"""An RGB picture, uint8 ``[height, width, 3]``."""

GOOD, BAD = "#009E73", "#D55E00"
"""The colours of an episode's end with and without a success."""

_DPI = 100


@dataclass(frozen=True, kw_only=True)
class Shot(ABC):
    """The visible state of one run at one step.

    Attributes:
        step: the number of steps so far.
        reward: the reward of this step.
        ended: whether the situation has ended.
        success: whether the situation has ended with a success.
    """

    step: int = 0
    reward: float = 0.0
    ended: bool = False
    success: bool = False

    @abstractmethod
    def draw(self, axes: Axes, film: Sequence[Self], title: str = "") -> None:
        """Draw this shot, the last of a film, with trails from the earlier shots.

        Args:
            axes: the axes to draw on; they are cleared first.
            film: at least one shot, in order of time.
            title: the panel's title.
        """

    @classmethod
    def in_view(cls, film: Sequence[Self]) -> list[Self]:
        """Return the shots of a film, which show all that moves in it."""
        return [*film]

    @property
    def edge(self) -> str:
        """The colour of the frame: grey, or that of the end."""
        return "0.4" if not self.ended else GOOD if self.success else BAD


class Canvas:
    """A figure of one or several panels that is reused for every frame.

    Args:
        panels: the number of panels.
        size_px: the width of a panel.
        titles: the panels' titles; none by default.
        columns: the number of columns; by default about the number of rows.
    """

    @own_style()
    def __init__(
        self,
        panels: int = 1,
        size_px: int = 360,
        titles: Sequence[str] = (),
        columns: int | None = None,
    ) -> None:
        columns = columns or ceil(sqrt(panels))
        rows = ceil(panels / columns)
        lines = 2 if titles else 1
        head = 16 * lines / size_px  # height of the title, as a share of a panel
        size_in = columns * size_px / _DPI, rows * (1 + head) * size_px / _DPI
        self._figure = Figure(figsize=size_in, dpi=_DPI)
        self._canvas = FigureCanvasAgg(self._figure)
        grid = [*self._figure.subplots(rows, columns, squeeze=False).flat]
        self._axes, self._titles = grid[:panels], [*titles] or [""] * panels
        for axes in grid[panels:]:
            axes.set_axis_off()
        self._figure.subplots_adjust(0.005, 0.005, 0.995, 1 - head / rows, 0.03, head + 0.02)

    @own_style()
    def draw(self, films: Sequence[Sequence[Shot]]) -> Image:
        """Return a picture of the last shot of each film, with trails from the earlier shots.

        Args:
            films: for each panel, at least one shot, in order of time.
        """
        for axes, title, film in zip(self._axes, self._titles, films, strict=True):
            film[-1].draw(axes, film, title)
        canvas: Any = self._canvas  # Any, since its methods have no type annotations
        canvas.draw()
        image: Image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        return image


def write_title(axes: Axes, film: Sequence[Shot], title: str) -> None:
    """Write a panel's title, with the number of steps and the sum of rewards below it."""
    words = f"step {film[-1].step}   reward {sum(each.reward for each in film):+.2f}"
    axes.set_title(f"{title}\n{words}" if title else words, fontsize=8, pad=3)


def add(axes: Axes, patch: Patch, **looks: Any) -> None:
    """Add a patch with these looks."""
    patch.set(**looks)
    axes.add_patch(patch)
