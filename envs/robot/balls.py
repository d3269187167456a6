"""A ball that rolls on a circle around the origin."""

import torch
from torch import Tensor


def position(angle_rad: Tensor, circle_radius_m: float) -> tuple[Tensor, Tensor]:
    """Return the ball's position: x = R cos φ, y = R sin φ, in metres, shaped as ``angle_rad``."""
    return circle_radius_m * torch.cos(angle_rad), circle_radius_m * torch.sin(angle_rad)


def roll(angle_rad: Tensor, speed_radps: Tensor, time_step_s: float) -> Tensor:
    """Return the ball's angle after a time step, φ + ω_b·dt, in rad."""
    return angle_rad + speed_radps * time_step_s


def random_start(
    u: Tensor,
    v: Tensor,
    heads: Tensor,
    start_angle_rad: float,
    speed_range_radps: tuple[float, float],
) -> tuple[Tensor, Tensor]:
    """Return a random start: φ₀ ~ U(−φ_max, φ_max), |ω_b| ~ U(low, high), ω_b's sign a fair coin.

    Args:
        u, v: random numbers from U[0, 1), any shape.
        heads: a fair coin (bool), same shape.
        start_angle_rad: φ_max.
        speed_range_radps: the lowest and the highest |ω_b|.

    Returns:
        φ₀ in rad and ω_b in rad/s, shaped as ``u``.
    """
    low, high = speed_range_radps
    angle_rad = start_angle_rad * (2 * u - 1)
    speed_radps = low + (high - low) * v
    return angle_rad, torch.where(heads, speed_radps, -speed_radps)
