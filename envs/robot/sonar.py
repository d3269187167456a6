"""A ring of sonars. Each sonar reads the distance to the nearest point in its beam."""

from math import inf
from typing import NamedTuple

import torch
from torch import Tensor

from envs.robot.geometry import Boxes, Discs, Point, Sector, Walls, between, encloses, rotated


class Ring(NamedTuple):
    """The sonars' places and directions on the robot, each entry ``[sensors]``.

    Attributes:
        x_m, y_m: distances from the robot's centre, forward and to the left.
        heading_rad: angle from the robot's heading, anticlockwise.
    """

    x_m: Tensor
    y_m: Tensor
    heading_rad: Tensor


def distances(
    robot: Point,
    heading_rad: Tensor,
    ring: Ring,
    sector: Sector,
    *,
    walls: Walls | None = None,
    boxes: Boxes | None = None,
    discs: Discs | None = None,
) -> Tensor:
    """Return the exact distance from each sonar to the nearest point in its beam, in metres.

    Args:
        robot, heading_rad: the robot's pose, ``[*batch]``.
        ring: the sonars.
        sector: the shape of every sonar's beam.
        walls: the field's walls; None for an open plane.
        boxes, discs: the objects that echo; None for none.

    Returns:
        ``[sensors, *batch]``: 0 inside an object, infinite if the beam meets nothing.
    """
    x_m, y_m, turn_rad = (values.view(-1, *[1] * robot.x.ndim) for values in ring)
    out = rotated(Point(x_m, y_m), torch.cos(heading_rad), torch.sin(heading_rad))
    place = Point(robot.x + out.x, robot.y + out.y)
    ahead_rad = heading_rad + turn_rad
    cosine, sine = torch.cos(ahead_rad), torch.sin(ahead_rad)

    def seen(points: Point) -> Point:
        """Return points ``[*objects, *batch]`` in each sonar's frame, sensors first."""
        shape = (len(x_m), *[1] * (points.x.ndim - robot.x.ndim), *robot.x.shape)
        here = Point(*(values.view(shape) for values in place))
        return rotated(between(here, points), cosine.view(shape), -sine.view(shape))

    nearest = torch.full_like(place.x, inf)
    if walls is not None:
        nearest = sector.to_walls(place, cosine, sine, walls)
    if boxes is not None:
        corners = seen(boxes.corners())
        sides = sector.to_polygons(corners).amin(2)
        nearest = torch.minimum(nearest, torch.where(encloses(corners), 0.0, sides).amin(1))
    if discs is not None:
        to_discs = sector.to_discs(seen(discs.centre), discs.radius_m)
        nearest = torch.minimum(nearest, to_discs.amin(1))
    return nearest


def readings(
    distance_m: Tensor,
    normals: Tensor | None,
    dropped: Tensor | None,
    *,
    noise_m: float,
    noise_share: float,
    range_m: tuple[float, float],
) -> Tensor:
    """Return sonar readings with noise, lost echoes and a limited range.

    The error is normal with standard deviation σ = noise_m + noise_share · distance. Without an
    echo, the reading is the end of the range. An echo is missing if it is dropped or if the object
    is beyond the range.

    Args:
        distance_m: exact distances, any shape; infinite without an object.
        normals: standard normal numbers, same shape; None without noise.
        dropped: whether each echo is lost (bool), same shape; None if no echo is lost.
        noise_m, noise_share: the constants of σ.
        range_m: the least and the greatest reading.

    Returns:
        Readings in metres within the range, shaped as ``distance_m``.
    """
    low_m, high_m = range_m
    echo = distance_m <= high_m
    if dropped is not None:
        echo = echo & ~dropped
    reading_m = distance_m
    if normals is not None:
        reading_m = distance_m + (noise_m + noise_share * distance_m) * normals
    return torch.where(echo, reading_m.clamp(low_m, high_m), high_m)
