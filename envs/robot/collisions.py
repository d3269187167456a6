"""Collisions of a disc-shaped robot with walls, boxes and discs during a step."""

import torch
from torch import Tensor

from envs.robot.geometry import (
    Boxes,
    Discs,
    Point,
    Walls,
    between,
    cuts_rectangle,
    square_to_segment,
    turned,
)


def collides(
    start: Point,
    end: Point,
    radius_m: float,
    *,
    walls: Walls | None = None,
    boxes: Boxes | None = None,
    discs: Discs | None = None,
) -> Tensor:
    """Return whether a robot touches anything on the straight line of a step.

    The whole line is tested, so that a long step can't jump over an obstacle.

    Args:
        start, end: the robot's centre before and after the step, ``[*batch]``.
        radius_m: the robot's radius.
        walls: the field's walls; None for an open plane.
        boxes, discs: the obstacles; None for none.

    Returns:
        Whether the robot touches anything (bool), ``[*batch]``.
    """
    way = between(start, end)
    touched = torch.zeros_like(start.x, dtype=torch.bool)
    if walls is not None:
        # The field is convex: a line from inside that ends inside stays inside.
        touched = touched | (end.x.abs() >= walls.half_width_m - radius_m)
        touched = touched | (end.y.abs() >= walls.half_height_m - radius_m)
    if discs is not None:
        reach_m = discs.radius_m + radius_m
        near = square_to_segment(discs.centre, start, way) <= reach_m * reach_m
        touched = touched | near.any(0)
    if boxes is not None:
        touched = touched | _meets_boxes(start, way, radius_m, boxes).any(0)
    return touched


def _meets_boxes(start: Point, way: Point, radius_m: float, boxes: Boxes) -> Tensor:
    """Return whether a moving disc touches each box (bool), ``[boxes, *batch]``.

    The disc touches a box if its centre enters a rectangle with rounded corners. This is the union
    of the box widened by the radius, the box heightened by it, and a disc at each corner.
    """
    half_x, half_y = boxes.half_width_m, boxes.half_height_m
    place, going = boxes.in_frame(start), turned(way, -boxes.heading_rad)
    met = cuts_rectangle(place, going, half_x + radius_m, half_y)
    met = met | cuts_rectangle(place, going, half_x, half_y + radius_m)
    for sign_x, sign_y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        corner = Point(sign_x * half_x, sign_y * half_y)
        met = met | (square_to_segment(corner, place, going) <= radius_m * radius_m)
    return met
