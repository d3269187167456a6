"""The vision of the robot's head: bearings, distances and visibility of balls."""

import math

import torch
from torch import Tensor

from envs.robot.geometry import (
    Boxes,
    Discs,
    Point,
    between,
    cuts_rectangle,
    square_to_segment,
    turned,
)


def wrap(angle_rad: Tensor) -> Tensor:
    """Return the equivalent angle in [−π, π); rounding turns an angle just below −π into π."""
    return torch.remainder(angle_rad + math.pi, 2 * math.pi) - math.pi


def bearing(
    direction_rad: Tensor, heading_rad: Tensor | float, noise_rad: Tensor, field_of_view_rad: float
) -> Tensor:
    """Return the angle Δθ from the robot's heading to the ball, as the head reports it.

    Δθ is the true bearing, wrapped to [−π, π), plus noise, clipped to the field of view. So a ball
    outside the field of view is reported at the edge on the ball's side.

    Args:
        direction_rad: the direction from the robot to the ball, against the world's x axis, any
            shape.
        heading_rad: the robot's heading, same shape or a number.
        noise_rad: the sensor's error, same shape.
        field_of_view_rad: the largest angle that the head reports, to either side.

    Returns:
        Δθ in rad, positive to the left, same shape.
    """
    true_rad = wrap(direction_rad - heading_rad)
    return (true_rad + noise_rad).clamp(-field_of_view_rad, field_of_view_rad)


def hidden(
    eye: Point, balls: Discs, *, boxes: Boxes | None = None, discs: Discs | None = None
) -> Tensor:
    """Return whether something cuts the line from the eye to each ball's centre.

    Args:
        eye: the head's place, ``[*batch]``.
        balls: the balls; a ball also hides the balls behind it.
        boxes, discs: the obstacles; None for none. Walls enclose the field, so they hide nothing.

    Returns:
        Whether each ball is hidden (bool), ``[balls, *batch]``.
    """
    lines = between(eye, balls.centre)
    number = len(lines.x)

    def cut(ball: int) -> Tensor:
        line = Point(lines.x[ball], lines.y[ball])
        met = torch.zeros_like(line.x, dtype=torch.bool)
        for other in range(number):
            if other != ball:
                centre, reach_m = (
                    Point(balls.x_m[other], balls.y_m[other]),
                    balls.radius_m[other],
                )
                met = met | (square_to_segment(centre, eye, line) < reach_m * reach_m)
        if discs is not None:
            near = square_to_segment(discs.centre, eye, line) < discs.radius_m * discs.radius_m
            met = met | near.any(0)
        if boxes is not None:
            start, way = boxes.in_frame(eye), turned(line, -boxes.heading_rad)
            half = boxes.half_width_m, boxes.half_height_m
            met = met | cuts_rectangle(start, way, *half).any(0)
        return met

    return torch.stack([cut(ball) for ball in range(number)])


def in_sight(
    bearing_rad: Tensor, distance_m: Tensor, *, field_of_view_rad: float, range_m: float
) -> Tensor:
    """Return whether an object is within the field of view and the range (bool).

    Args:
        bearing_rad: the object's angle from the heading, in [−π, π), any shape.
        distance_m: the object's distance, same shape.
        field_of_view_rad: the largest visible angle to either side.
        range_m: the largest visible distance.
    """
    return (bearing_rad.abs() <= field_of_view_rad) & (distance_m <= range_m)


def nearest(distance_m: Tensor, allowed: Tensor, *values: Tensor) -> tuple[Tensor, ...]:
    """Select the nearest allowed ball, or the first ball if no ball is allowed.

    Args:
        distance_m: the balls' distances, ``[balls, *batch]``.
        allowed: whether each ball may be selected (bool), same shape.
        *values: further values of each ball, same shape.

    Returns:
        Whether a ball is allowed (bool), the selected ball's distance, and its entry of each of
        ``values``, each ``[*batch]``.
    """
    found, least = allowed[0], distance_m[0]
    picked = [value[0] for value in values]
    for ball in range(1, len(distance_m)):
        nearer = allowed[ball] & (~found | (distance_m[ball] < least))
        least = torch.where(nearer, distance_m[ball], least)
        picked = [
            torch.where(nearer, value[ball], old) for value, old in zip(values, picked, strict=True)
        ]
        found = found | allowed[ball]
    return found, least, *picked


def rounded(angle_rad: Tensor, resolution_rad: float) -> Tensor:
    """Return the nearest multiple of the resolution; the unchanged angle if the resolution is 0."""
    if resolution_rad == 0:
        return angle_rad
    return torch.floor(angle_rad / resolution_rad + 0.5) * resolution_rad
