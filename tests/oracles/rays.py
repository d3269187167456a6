"""Sonar readings found by rays alone: slow, and written to be read."""

from math import atan2, cos, hypot, inf, radians, remainder, sin, tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Spot = tuple[float, float]
Rays = NDArray[np.float64]
"""Unit vectors, [rays, 2]."""


class Disc(NamedTuple):
    """A filled disc."""

    x: float
    y: float
    radius: float

    def along(self, spot: Spot, rays: Rays) -> tuple[Rays, Rays]:
        """Return each ray's distance to the disc (inf if it misses) and its cosine of incidence."""
        x, y = self.x - spot[0], self.y - spot[1]
        ahead, off = x * rays[:, 0] + y * rays[:, 1], x * rays[:, 1] - y * rays[:, 0]
        half_chord = np.sqrt(np.maximum(self.radius**2 - off**2, 0))
        met = (ahead > 0) & (np.abs(off) <= self.radius)
        return np.where(met, ahead - half_chord, inf), half_chord / self.radius

    def holds(self, spot: Spot) -> bool:
        """Return True if a point is in the disc."""
        return hypot(self.x - spot[0], self.y - spot[1]) <= self.radius

    def landmarks(self, spot: Spot) -> list[Spot]:
        """Return the centre: the nearest point of the disc is in its direction."""
        return [(self.x, self.y)]


class Side(NamedTuple):
    """A segment."""

    start: Spot
    end: Spot

    def along(self, spot: Spot, rays: Rays) -> tuple[Rays, Rays]:
        """Return each ray's distance to the side (inf if it misses) and its cosine of incidence."""
        x, y = self.start[0] - spot[0], self.start[1] - spot[1]
        side_x, side_y = self.end[0] - self.start[0], self.end[1] - self.start[1]
        across = rays[:, 0] * side_y - rays[:, 1] * side_x
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            way = (x * side_y - y * side_x) / across
            share = (x * rays[:, 1] - y * rays[:, 0]) / across
        met = (way >= 0) & (share >= 0) & (share <= 1)
        return np.where(met, way, inf), np.abs(across) / hypot(side_x, side_y)

    def landmarks(self, spot: Spot) -> list[Spot]:
        """Return the ends, and the foot of the perpendicular from the spot."""
        side_x, side_y = self.end[0] - self.start[0], self.end[1] - self.start[1]
        x, y = spot[0] - self.start[0], spot[1] - self.start[1]
        share = (x * side_x + y * side_y) / (side_x**2 + side_y**2)
        foot = self.start[0] + share * side_x, self.start[1] + share * side_y
        return [self.start, self.end, foot]


class Box(NamedTuple):
    """A filled rectangle; its first side is along its heading."""

    x: float
    y: float
    width: float
    height: float
    heading: float

    def sides(self) -> list[Side]:
        """Return the four sides, anticlockwise."""
        corners = [
            (
                self.x + cos(self.heading) * x * self.width - sin(self.heading) * y * self.height,
                self.y + sin(self.heading) * x * self.width + cos(self.heading) * y * self.height,
            )
            for x, y in ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
        ]
        return [Side(*ends) for ends in zip(corners, corners[1:] + corners[:1], strict=True)]

    def holds(self, spot: Spot) -> bool:
        """Return True if a point is in the box."""
        x, y = spot[0] - self.x, spot[1] - self.y
        across = cos(self.heading) * x + sin(self.heading) * y
        up = cos(self.heading) * y - sin(self.heading) * x
        return abs(across) <= self.width / 2 and abs(up) <= self.height / 2


def reading(
    spot: Spot,
    heading: float,
    width: float,
    discs: list[Disc],
    boxes: list[Box],
    walls: list[Side],
    max_incidence_deg: float | None = None,
    rays: int = 200,
) -> float:
    """Return the distance to the nearest point that any ray in a sector meets.

    The rays are an even fan, with extra rays at and just beside every point that may be the nearest
    of its object. The ends of segments echo at any angle.
    """
    if any(thing.holds(spot) for thing in (*discs, *boxes)):
        return 0.0
    things = [*discs, *walls, *(side for box in boxes for side in box.sides())]
    angles = [width * (number / (rays - 1) - 0.5) for number in range(rays)]
    nearest = inf
    for thing in things:
        for x, y in thing.landmarks(spot):
            angle = remainder(atan2(y - spot[1], x - spot[0]) - heading, tau)
            angles += [angle - 1e-9, angle, angle + 1e-9]
        for end in (thing.start, thing.end) if isinstance(thing, Side) else ():
            angle = remainder(atan2(end[1] - spot[1], end[0] - spot[0]) - heading, tau)
            if abs(angle) <= width / 2:
                nearest = min(nearest, hypot(end[0] - spot[0], end[1] - spot[1]))
    directions = heading + np.array([angle for angle in angles if abs(angle) <= width / 2])
    fan = np.stack([np.cos(directions), np.sin(directions)], 1)
    least = -1.0 if max_incidence_deg is None else cos(radians(max_incidence_deg))
    for thing in things:
        way, cosine = thing.along(spot, fan)
        nearest = min([nearest, *way[cosine >= least]])
    return float(nearest)


def field(width: float, height: float) -> list[Side]:
    """Return the walls of a field around the origin."""
    return Box(0, 0, width, height, 0).sides()


def blocked(spot: Spot, target: Spot, discs: list[Disc], boxes: list[Box]) -> bool:
    """Return True if anything lies on the line from a spot to a target, or covers either."""
    things = [*discs, *(side for box in boxes for side in box.sides())]
    if any(thing.holds(spot) or thing.holds(target) for thing in (*discs, *boxes)):
        return True
    angle = atan2(target[1] - spot[1], target[0] - spot[0])
    ray = np.array([[cos(angle), sin(angle)]])
    far = hypot(target[0] - spot[0], target[1] - spot[1])
    return any(thing.along(spot, ray)[0][0] < far for thing in things)
