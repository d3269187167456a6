"""The kinematics of a robot with two driven wheels."""

import torch
from torch import Tensor


def wheel_speeds(steering: Tensor, speed_mps: float | Tensor) -> tuple[Tensor, Tensor]:
    """Return the wheels' speeds: v_left = V₀(1 + Δv), v_right = V₀(1 − Δv) (paper, eq. 10, 11).

    Args:
        steering: Δv in [−1, 1], any shape; positive turns right.
        speed_mps: V₀, the speed of the robot's centre.

    Returns:
        The left and the right wheel's speed in m/s, shaped as ``steering``.
    """
    return speed_mps * (1 + steering), speed_mps * (1 - steering)


def drive(
    x_m: Tensor,
    y_m: Tensor,
    heading_rad: Tensor,
    left_mps: Tensor,
    right_mps: Tensor,
    track_width_m: float,
    time_step_s: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the pose after a time step at constant wheel speeds. The path is an arc of a circle.

    With v = (v_left + v_right)/2, ω = (v_right − v_left)/L and half the turn h = ω·dt/2, the arc's
    chord has the length v·dt·sin(h)/h and the direction θ + h. Headings grow counter-clockwise.

    Args:
        x_m, y_m, heading_rad: the pose, any shape.
        left_mps, right_mps: the wheels' speeds, same shape.
        track_width_m: L, the distance between the wheels.
        time_step_s: dt.

    Returns:
        The new x and y in m, and the new heading in rad (not wrapped).
    """
    speed_mps = (left_mps + right_mps) / 2
    half_turn = (right_mps - left_mps) * (time_step_s / (2 * track_width_m))
    chord_m = speed_mps * time_step_s * torch.sinc(half_turn / torch.pi)
    direction = heading_rad + half_turn
    return (
        x_m + chord_m * torch.cos(direction),
        y_m + chord_m * torch.sin(direction),
        heading_rad + 2 * half_turn,
    )
