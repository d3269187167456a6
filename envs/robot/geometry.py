"""Segments, discs, boxes and sectors in the plane. The objects are the first dimension.

Every function takes tensors of any shapes that broadcast and has no data-dependent control flow.
The distance is infinite if no point meets the condition.
"""

from math import cos, inf, sin, tan
from typing import NamedTuple

import torch
from torch import Tensor


class Point(NamedTuple):
    """Points or vectors: two tensors of the same shape, in metres."""

    x: Tensor
    y: Tensor


class Walls(NamedTuple):
    """The walls of a rectangular field, centred on the origin and parallel to the axes."""

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
        """Return these discs followed by others."""
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
        """Return a point in each box's frame: origin at its centre, x axis along its heading."""
        return turned(between(self.centre, point), -self.heading_rad)

    def corners(self) -> Point:
        """Return the corners in anticlockwise order, ``[boxes, 4, *batch]``."""
        signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        x = torch.stack([sign * self.half_width_m for sign, _ in signs], 1)
        y = torch.stack([sign * self.half_height_m for _, sign in signs], 1)
        out = turned(Point(x, y), self.heading_rad.unsqueeze(1))
        return Point(self.x_m.unsqueeze(1) + out.x, self.y_m.unsqueeze(1) + out.y)


def between(start: Point, end: Point) -> Point:
    """Return the vector from ``start`` to ``end``."""
    return Point(end.x - start.x, end.y - start.y)


def turned(vector: Point, angle_rad: Tensor) -> Point:
    """Return a vector turned anticlockwise by an angle."""
    return rotated(vector, torch.cos(angle_rad), torch.sin(angle_rad))


def rotated(vector: Point, cosine: Tensor, sine: Tensor) -> Point:
    """Return a vector turned anticlockwise by the angle with this cosine and sine."""
    return Point(cosine * vector.x - sine * vector.y, sine * vector.x + cosine * vector.y)


def square(vector: Point) -> Tensor:
    """Return the square of a vector's length."""
    return vector.x * vector.x + vector.y * vector.y


def dot(left: Point, right: Point) -> Tensor:
    """Return the scalar product of two vectors."""
    return left.x * right.x + left.y * right.y


def cross(left: Point, right: Point) -> Tensor:
    """Return the vector product's third component: > 0 if ``right`` is to the left of ``left``."""
    return left.x * right.y - left.y * right.x


class Sector(NamedTuple):
    """The sector with its tip at the origin and its middle along the x axis.

    Attributes:
        half_width_rad: the angle from the middle to either edge, in (0, π/2).
        max_incidence_rad: the largest angle between a ray and a surface's normal at which the
            surface is detected. Corners are always detected. None for no limit.
    """

    half_width_rad: float
    max_incidence_rad: float | None = None

    def holds(self, point: Point) -> Tensor:
        """Return whether each point lies in the sector (bool)."""
        return point.y.abs() * cos(self.half_width_rad) <= point.x * sin(self.half_width_rad)

    def to_polygons(self, corners: Point) -> Tensor:
        """Return the distance from the origin to each polygon side within the sector.

        Each side is first clipped to the sector. The nearest point of the clipped side is the foot
        of the perpendicular from the origin, clamped to the side's ends.

        Args:
            corners: in order round each polygon, ``[sensors, polygons, corners, *batch]``.

        Returns:
            Distances in metres, ``[sensors, polygons, sides, *batch]``; infinite for sides outside
            the sector.
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
            # Signed distances of the corners beyond an edge of the sector.
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
        """Return the distance from the sector's tip to the nearest wall within the sector.

        The walls enclose the tip, so each wall may be treated as an endless line: beyond the wall's
        end, the adjacent wall is nearer. A line at distance d along its normal n is d/(u·n) away
        in the direction u. The nearest point lies in the sector's direction closest to n.

        Args:
            place: the position of the sector's tip, within the walls.
            cosine, sine: the cosine and sine of the direction of the sector's middle.
            walls: the field's walls.

        Returns:
            Distances in metres, shaped as ``place``.
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
        """Return the distance from the origin to each disc within the sector; 0 inside a disc.

        If the disc's centre is in the sector, the nearest point lies towards the centre. Otherwise
        it lies on the sector's nearer edge.

        Args:
            centre: the discs' centres in the sector's frame.
            radius_m: the discs' radii.

        Returns:
            Distances in metres, shaped as the centres; infinite for discs outside the sector.
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
    """Return each corner's next value round the polygon, shaped as ``values``."""
    return torch.cat([values[:, :, 1:], values[:, :, :1]], 2)


def encloses(corners: Point) -> Tensor:
    """Return whether convex polygons contain the origin (bool), ``[sensors, polygons, *batch]``.

    Args:
        corners: in anticlockwise order, ``[sensors, polygons, corners, *batch]``.
    """
    left = cross(corners, Point(*(_following(values) for values in corners))) >= 0
    inside = left[:, :, 0]
    for corner in range(1, left.shape[2]):
        inside = inside & left[:, :, corner]
    return inside


def square_to_segment(point: Point, start: Point, way: Point) -> Tensor:
    """Return the squared distance from a point to the segment from ``start`` to ``start + way``.

    Args:
        point, start, way: any shapes that broadcast; ``way`` may be zero.
    """
    out = between(start, point)
    length2 = square(way)
    share = dot(out, way) / torch.where(length2 > 0, length2, 1)
    share = share.clamp(0, 1)
    return square(Point(out.x - share * way.x, out.y - share * way.y))


def cuts_rectangle(start: Point, way: Point, half_width_m: Tensor, half_height_m: Tensor) -> Tensor:
    """Return whether a segment meets an axis-parallel rectangle around the origin (bool).

    The separating axis theorem: the two are disjoint exactly if their projections onto a normal of
    the rectangle's sides or of the segment are disjoint.
    """
    middle = Point(start.x + way.x / 2, start.y + way.y / 2)
    half_x, half_y = way.x.abs() / 2, way.y.abs() / 2
    across = half_width_m * half_y + half_height_m * half_x
    return (
        (middle.x.abs() <= half_width_m + half_x)
        & (middle.y.abs() <= half_height_m + half_y)
        & (cross(middle, Point(way.x / 2, way.y / 2)).abs() <= across)
    )
