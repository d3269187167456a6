"""Segments, discs, boxes and sectors in the plane. The objects are the first dimension.

Every function takes tensors of any shapes that broadcast, and none looks at its data. The distance
to a point that isn't there is infinite.
"""

from math import cos, inf, sin, tan
from typing import NamedTuple

import torch
from torch import Tensor


class Point(NamedTuple):
    """Points, or vectors: two tensors of one shape, in metres."""

    x: Tensor
    y: Tensor


class Walls(NamedTuple):
    """The walls of a rectangular field around the origin, along the axes."""

    half_width_m: float
    half_height_m: float


class Discs(NamedTuple):
    """Filled discs, each entry ``[discs, *batch]``."""

    x_m: Tensor
    y_m: Tensor
    radius_m: Tensor

    @property
    def centre(self) -> Point:
        """The centres."""
        return Point(self.x_m, self.y_m)

    def and_those(self, others: "Discs") -> "Discs":
        """These discs and others."""
        return Discs(*(torch.cat(both) for both in zip(self, others, strict=True)))


class Boxes(NamedTuple):
    """Filled rectangles, each entry ``[boxes, *batch]``."""

    x_m: Tensor
    y_m: Tensor
    half_width_m: Tensor  # along the heading
    half_height_m: Tensor
    heading_rad: Tensor

    @property
    def centre(self) -> Point:
        """The centres."""
        return Point(self.x_m, self.y_m)

    def in_frame(self, point: Point) -> Point:
        """A point of the world as it lies to each box: from its centre, x along its heading."""
        return turned(between(self.centre, point), -self.heading_rad)

    def corners(self) -> Point:
        """The corners, anticlockwise: ``[boxes, 4, *batch]``."""
        signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        x = torch.stack([sign * self.half_width_m for sign, _ in signs], 1)
        y = torch.stack([sign * self.half_height_m for _, sign in signs], 1)
        out = turned(Point(x, y), self.heading_rad.unsqueeze(1))
        return Point(self.x_m.unsqueeze(1) + out.x, self.y_m.unsqueeze(1) + out.y)


def between(start: Point, end: Point) -> Point:
    """The vector from one point to another."""
    return Point(end.x - start.x, end.y - start.y)


def turned(vector: Point, angle_rad: Tensor) -> Point:
    """A vector turned anticlockwise."""
    return rotated(vector, torch.cos(angle_rad), torch.sin(angle_rad))


def rotated(vector: Point, cosine: Tensor, sine: Tensor) -> Point:
    """A vector turned anticlockwise by the angle that has this cosine and sine."""
    return Point(cosine * vector.x - sine * vector.y, sine * vector.x + cosine * vector.y)


def square(vector: Point) -> Tensor:
    """The square of a vector's length."""
    return vector.x * vector.x + vector.y * vector.y


def dot(left: Point, right: Point) -> Tensor:
    """The scalar product."""
    return left.x * right.x + left.y * right.y


def cross(left: Point, right: Point) -> Tensor:
    """The third component of the vector product: positive if ``right`` is to the left."""
    return left.x * right.y - left.y * right.x


class Sector(NamedTuple):
    """What lies within half a width to either side of the x axis, as seen from the origin.

    Attributes:
        half_width_rad: in (0, π/2).
        max_incidence_rad: a surface met at more than that from its normal is left out, but for its
            corners; None for no such limit.
    """

    half_width_rad: float
    max_incidence_rad: float | None = None

    def holds(self, point: Point) -> Tensor:
        """Return whether points lie in the sector (bool)."""
        return point.y.abs() * cos(self.half_width_rad) <= point.x * sin(self.half_width_rad)

    def to_polygons(self, corners: Point) -> Tensor:
        """The distance to the nearest point in the sector of each side of polygons.

        Each side is clipped to the sector; of what is left, the nearest point is the foot of the
        perpendicular, or else the end that is nearer to it.

        Args:
            corners: one after the other, ``[sensors, polygons, corners, *batch]``.

        Returns:
            ``[sensors, polygons, sides, *batch]``.
        """
        start, end = corners, Point(*(_following(values) for values in corners))
        side = between(start, end)
        square_m2 = square(side)
        foot = -dot(start, side) / square_m2
        sine, cosine = sin(self.half_width_rad), cos(self.half_width_rad)
        first, last = torch.zeros_like(foot), torch.ones_like(foot)
        lost = torch.zeros_like(foot, dtype=torch.bool)
        in_sector = torch.ones_like(lost)
        for edge in (1, -1):
            # How far the corners are beyond an edge of the sector.
            beyond = edge * cosine * start.y - sine * start.x
            beyond_next = _following(beyond)
            at_edge = beyond / (beyond - beyond_next)
            first = torch.where(beyond > 0, torch.maximum(first, at_edge), first)
            last = torch.where(beyond_next > 0, torch.minimum(last, at_edge), last)
            lost = lost | ((beyond > 0) & (beyond_next > 0))
            in_sector = in_sector & (beyond <= 0)
        if self.max_incidence_rad is not None:
            off = cross(start, side).abs() * tan(self.max_incidence_rad) / square_m2
            first, last = torch.maximum(first, foot - off), torch.minimum(last, foot + off)
        lost = lost | (first > last)
        at = torch.minimum(torch.maximum(foot, first), last)
        nearest = torch.sqrt(square(Point(start.x + at * side.x, start.y + at * side.y)))
        nearest = torch.where(lost, inf, nearest)
        if self.max_incidence_rad is not None:
            corner = torch.where(in_sector, torch.sqrt(square(start)), inf)
            nearest = torch.minimum(nearest, corner)
        return nearest

    def to_walls(self, place: Point, cosine: Tensor, sine: Tensor, walls: Walls) -> Tensor:
        """The distance to the nearest point in the sector of walls all round it.

        The walls enclose the place, so that each may be taken for an endless line: where it isn't a
        wall any more, the next one is nearer. A line at the distance d along its normal n is
        d/(u·n) away in the direction u. Of the sector's directions, the one nearest to n counts.

        Args:
            place: where the sector's origin is, within the walls.
            cosine, sine: of the direction of its middle.
            walls: of the field.

        Returns:
            Of the shape of the place.
        """
        cos_half, sin_half = cos(self.half_width_rad), sin(self.half_width_rad)
        ahead = Point(cosine, sine)
        left = Point(cosine * cos_half - sine * sin_half, sine * cos_half + cosine * sin_half)
        right = Point(cosine * cos_half + sine * sin_half, sine * cos_half - cosine * sin_half)
        nearest = torch.full_like(place.x, inf)
        for axis, half_m in enumerate(walls):
            for sign in (1, -1):
                facing = sign * ahead[axis] >= cos_half
                is_left = sign * left[axis] > sign * right[axis]
                towards = sign * torch.where(is_left, left[axis], right[axis])
                towards = torch.where(facing, 1.0, towards)
                away_m = (half_m - sign * place[axis]) / towards
                met = towards > 0
                if self.max_incidence_rad is not None:
                    met = towards >= cos(self.max_incidence_rad)
                    other = 1 - axis
                    aside = torch.where(is_left, left[other], right[other])
                    aside = torch.where(facing, 0.0, aside)
                    met = met & ((place[other] + aside * away_m).abs() <= walls[other])
                nearest = torch.minimum(nearest, torch.where(met, away_m, inf))
        if self.max_incidence_rad is not None:
            for x_m in (walls.half_width_m, -walls.half_width_m):
                for y_m in (walls.half_height_m, -walls.half_height_m):
                    corner = Point(x_m - place.x, y_m - place.y)
                    seen = self.holds(rotated(corner, cosine, -sine))
                    corner_m = torch.where(seen, torch.sqrt(square(corner)), inf)
                    nearest = torch.minimum(nearest, corner_m)
        return nearest

    def to_discs(self, centre: Point, radius_m: Tensor) -> Tensor:
        """The distance to the nearest point in the sector of each disc; inside a disc it is 0.

        That point lies towards the centre or, where the centre isn't in the sector, on the nearer
        edge.

        Args:
            centre, radius_m: of the discs, as seen from the origin.

        Returns:
            Of that shape.
        """
        sine, cosine = sin(self.half_width_rad), cos(self.half_width_rad)
        distance_m = torch.sqrt(square(centre))
        along = centre.x * cosine + centre.y.abs() * sine
        off = centre.y.abs() * cosine - centre.x * sine  # of the centre from the nearer edge
        most = 1.0 if self.max_incidence_rad is None else sin(self.max_incidence_rad)
        cut = (along > 0) & (off <= most * radius_m)
        half_chord = torch.sqrt((radius_m * radius_m - off * off).clamp(min=0))
        at_edge = torch.where(cut, along - half_chord, inf)
        nearest = torch.where(off <= 0, distance_m - radius_m, at_edge)
        return torch.where(distance_m <= radius_m, 0.0, nearest)


def _following(values: Tensor) -> Tensor:
    """The next corner's value at each corner, ``[sensors, polygons, corners, *batch]``."""
    return torch.cat([values[:, :, 1:], values[:, :, :1]], 2)


def encloses(corners: Point) -> Tensor:
    """Return whether polygons hold the origin, ``[sensors, polygons, *batch]`` (bool).

    Args:
        corners: anticlockwise, ``[sensors, polygons, corners, *batch]``.
    """
    left = cross(corners, Point(*(_following(values) for values in corners))) >= 0
    inside = left[:, :, 0]
    for corner in range(1, left.shape[2]):
        inside = inside & left[:, :, corner]
    return inside


def square_to_segment(point: Point, start: Point, way: Point) -> Tensor:
    """The square of a point's distance from the segment that leads ``way`` from ``start``.

    Args:
        point, start, way: of any shapes that broadcast; the way may be nothing.
    """
    out = between(start, point)
    length2 = square(way)
    share = dot(out, way) / torch.where(length2 > 0, length2, 1)
    share = share.clamp(0, 1)
    return square(Point(out.x - share * way.x, out.y - share * way.y))


def cuts_rectangle(start: Point, way: Point, half_width_m: Tensor, half_height_m: Tensor) -> Tensor:
    """Return whether a segment meets the rectangle around the origin along the axes (bool).

    By separating axes: two convex sets don't meet if they don't overlap as seen along one of the
    rectangle's sides or along the segment.
    """
    middle = Point(start.x + way.x / 2, start.y + way.y / 2)
    half_x, half_y = way.x.abs() / 2, way.y.abs() / 2
    across = half_width_m * half_y + half_height_m * half_x
    return (
        (middle.x.abs() <= half_width_m + half_x)
        & (middle.y.abs() <= half_height_m + half_y)
        & (cross(middle, Point(way.x / 2, way.y / 2)).abs() <= across)
    )
