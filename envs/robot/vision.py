"""The ball's bearing as the robot sees it."""

import math

import torch
from torch import Tensor


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
