"""The robot's view of the ball: its bearing."""

import math

import torch
from torch import Tensor


def wrap(angle_rad: Tensor) -> Tensor:
    """Return the same angle in [−π, π); of one just below −π, rounding may make π itself."""
    return torch.remainder(angle_rad + math.pi, 2 * math.pi) - math.pi


def bearing(
    direction_rad: Tensor, heading_rad: Tensor | float, noise_rad: Tensor, field_of_view_rad: float
) -> Tensor:
    """The angle Δθ from the robot's heading to the ball, as the head reports it.

    The true bearing, wrapped to [−π, π), plus noise, clipped to the field of view: a ball outside
    it is reported at the edge on its side.

    Args:
        direction_rad: of the ball from the robot, against the world's x axis, any shape.
        heading_rad: the robot's heading, same shape or a number.
        noise_rad: the sensor's error, same shape.
        field_of_view_rad: the largest angle that the head reports, to either side.

    Returns:
        Δθ in rad, positive to the left, same shape.
    """
    true_rad = wrap(direction_rad - heading_rad)
    return (true_rad + noise_rad).clamp(-field_of_view_rad, field_of_view_rad)
