"""The side of straight ahead on which a situation begins, where it is to be one side alone."""

import torch
from torch import Tensor


def sign(episode: Tensor, side: str, switch_after: int, dtype: torch.dtype) -> Tensor | float:
    """Which side it is: 1 is the left, where angles are positive, and −1 the right.

    Args:
        episode: its number, int64, any shape.
        side: ``left`` or ``right``.
        switch_after: from this episode on it is the other side; 0 is never.
        dtype: of the result.

    Returns:
        ±1, shaped as ``episode``, or a number if the side never changes.
    """
    first = 1.0 if side == "left" else -1.0
    if not switch_after:
        return first
    return first * (1 - 2 * (episode >= switch_after).to(dtype))


def mirrored(angle_rad: Tensor, sign: Tensor | float) -> Tensor:
    """The angle on that side: itself or its mirror image, ±|angle|.

    Args:
        angle_rad: in rad, any shape.
        sign: of :func:`sign`, same shape or a number.
    """
    return sign * angle_rad.abs()


def clipped(angle_rad: Tensor, sign: Tensor | float, other_rad: float) -> Tensor:
    """The angle, but on the other side no farther out than so much.

    Args:
        angle_rad: in rad, any shape.
        sign: of :func:`sign`, same shape or a number.
        other_rad: the largest angle on the other side.
    """
    return sign * (sign * angle_rad).clamp(min=-other_rad)
