"""Pictures as plain shapes, which Matplotlib draws here and a page draws in the browser."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from envs.canvas import Shot, add, write_title
from envs.pictures import Axes, Circle, Polygon

Spot = tuple[float, float]
"""x and y in the coordinates of the picture."""

Span = tuple[float, float]
"""The lowest and the highest coordinate that the picture shows."""

INKS = {
    "body": "#0072B2",
    "link": "#E69F00",
    "flag": "#009E73",
    "dark": "0.2",
    "ground": "0.4",
    "faint": "0.8",
    "earth": "0.92",
    "page": "white",
}
"""The colours by their names; a page has others for readers in the dark."""


@dataclass(frozen=True)
class Look:
    """The look of a shape.

    Attributes:
        ink: the colour of the line or of the text; empty for none.
        fill: the colour inside; empty for none.
        width_pt: the width of the line, or the height of the text, in points of a panel that is
            3.6 inches wide.
        radius: the radius of a disc in the coordinates of the picture; 0 for other shapes.
        dashed: whether the line is dashed.
        text: the text; empty for other shapes. It stands on its place, or hangs from it.
        hangs: whether the text hangs.
    """

    ink: str = ""
    fill: str = ""
    width_pt: float = 1.0
    radius: float = 0.0
    dashed: bool = False
    text: str = ""
    hangs: bool = False


@dataclass(frozen=True)
class Shape:
    """A line through places, a filled polygon with them as corners, or a disc or text at one.

    Attributes:
        places: the places.
        look: the look.
    """

    places: Sequence[Spot]
    look: Look

    def draw(self, axes: Axes, layer: int) -> None:
        """Draw the shape above those with a lower layer."""
        look, (x, y) = self.look, self.places[0]
        ink, fill = (INKS.get(name, "none") for name in (look.ink, look.fill))
        if look.text:
            align = "top" if look.hangs else "bottom"
            words = axes.text(x, y, look.text, ha="center", va=align, zorder=layer)
            words.set(color=ink, fontsize=look.width_pt)
        elif look.radius or look.fill:
            patch = Circle((x, y), look.radius) if look.radius else Polygon([*self.places])
            looks = {"facecolor": fill, "edgecolor": ink, "linewidth": look.width_pt}
            add(axes, patch, **looks, zorder=layer)
        else:
            [line] = axes.plot(*zip(*self.places, strict=True), color=ink, zorder=layer)
            line.set(linewidth=look.width_pt, linestyle="--" if look.dashed else "-")
            line.set_solid_capstyle("round")


@dataclass(frozen=True)
class DrawnShot(Shot):
    """The base class of shots that are drawn from shapes: still ones, a trail, and moving ones."""

    trail_shots: ClassVar[int | None] = None
    """The number of the latest shots whose trail is drawn; None for all."""

    @abstractmethod
    def limits(self) -> tuple[Span, Span]:
        """Return the spans of x and y that the picture shows, the same in a whole film."""

    @abstractmethod
    def still(self) -> list[Shape]:
        """Return the shapes that are the same in a whole film."""

    @abstractmethod
    def moving(self, film: Sequence[Self]) -> list[Shape]:
        """Return the shapes of this shot, the last of a film, above the others."""

    @classmethod
    def trail(cls, film: Sequence[Self]) -> Shape | None:
        """Return the trail of a film, with a place for each shot; None if there is no trail."""
        return None

    def draw(self, axes: Axes, film: Sequence[Self], title: str = "") -> None:
        axes.clear()
        axes.set_aspect("equal")
        x, y = self.limits()
        axes.set_xlim(*x)
        axes.set_ylim(*y)
        axes.set_xticks([])
        axes.set_yticks([])
        for spine in axes.spines.values():
            spine.set(color=self.edge if self.ended else "0.85")
            spine.set_linewidth(2.5 if self.ended else 1)
        shapes, trail = self.still(), self.trail(film)
        if trail is not None:
            latest = trail.places[-(self.trail_shots or len(film)) :]
            shapes += [replace(trail, places=latest)]
        for layer, shape in enumerate([*shapes, *self.moving(film)], start=1):
            shape.draw(axes, layer)
        write_title(axes, film, title)
