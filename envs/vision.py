"""What the robot's head sees of the ball."""

import math

import torch
from torch import Tensor


def wrap(angle_rad: Tensor) -> Tensor:
    """The same angle in [−π, π); just below −π, rounding may give π itself."""
    return torch.remainder(angle_rad + math.pi, 2 * math.pi) - math.pi


def bearing(
    east_m: Tensor,
    north_m: Tensor,
    heading_rad: Tensor,
    noise_rad: Tensor,
    field_of_view_rad: float,
) -> Tensor:
    """The angle Δθ from the robot's heading to the ball, as the head reports it.

    The true bearing, wrapped to [−π, π), plus noise, clipped to the field of view: a ball outside
    it is reported at the edge on its side.

    Args:
        east_m, north_m: from the robot to the ball along the world's x and y, any shape.
        heading_rad: the robot's heading, same shape.
        noise_rad: the sensor's error, same shape.
        field_of_view_rad: the largest angle that the head reports, to either side.

    Returns:
        Δθ in rad, positive to the left, same shape.
    """
    true_rad = wrap(torch.atan2(north_m, east_m) - heading_rad)
    return (true_rad + noise_rad).clamp(-field_of_view_rad, field_of_view_rad)
