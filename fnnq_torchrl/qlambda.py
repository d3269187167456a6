"""Peng's Q(λ), one step of it (paper, Table 1 and eq. 4, 5). The runs are the last dimension.

Source: J. Peng, R. J. Williams, "Incremental multi-step Q-learning", Machine Learning 22, 1996.
The paper's Table 1 f prints Q̂ ← Q̂ + α·Tr; as in Peng & Williams it is Q̂ ← Q̂ + α·Tr·δ. Its V̂(s)
is printed as arg max Q̂; it is the max.
"""

from collections.abc import Iterable

import torch
from torch import Tensor

from fnnq_torchrl.config import TRACES


def td_errors(
    reward: Tensor,
    terminated: Tensor,
    value: Tensor,
    chosen_value: Tensor,
    next_value: Tensor,
    gamma: Tensor,
) -> tuple[Tensor, Tensor]:
    """δ = r + γV(s′) − V(s) and δ′ = r + γV(s′) − Q(s, a) (paper, eq. 4, 5).

    Args:
        reward: r, any shape; the others have the same or broadcast to it.
        terminated: s′ is an end (bool): V(s′) counts as 0.
        value: V(s) = max Q(s, ·).
        chosen_value: Q(s, a).
        next_value: V(s′) = max Q(s′, ·).
        gamma: γ, the discount.

    Returns:
        δ and δ′, both from the weights before the update.
    """
    target = reward + gamma * next_value.masked_fill(terminated, 0)
    return target - value, target - chosen_value


def squared_norm(gradient: Iterable[Tensor]) -> Tensor:
    """‖∇Q‖² of each run over all its weights: from tensors ``[*weights, runs]`` to ``[runs]``."""
    return torch.stack([g.square().flatten(0, -2).sum(0) for g in gradient]).sum(0)


def check_reading(reading: str) -> str:
    """The reading itself.

    Raises:
        ValueError: there is no such reading.
    """
    if reading not in TRACES:
        raise ValueError(f"trace={reading!r}: must be {' or '.join(TRACES)}")
    return reading


def step_h_scale(gradient: Iterable[Tensor], reading: str) -> Tensor | float:
    """What step h, Tr(s, a) ← Tr(s, a) + 1, adds to the trace, as a multiple of ∇Q(s, a).

    * ``output``, the paper to the letter: the trace *network's output* at (s, a) rises by one,
      which takes ∇Q/‖∇Q‖². (Exactly by one where Q is linear in the weights; not at all where
      ∇Q is zero, and nothing can make it.)
    * ``gradient``, today's semi-gradient traces: ∇Q itself.

    For a table both are the same.

    Args:
        gradient: ∇Q(s, a), tensors ``[*weights, runs]``.
        reading: ``"output"`` or ``"gradient"``.

    Returns:
        ``[runs]``, or 1.

    Raises:
        ValueError: there is no such reading.
    """
    if check_reading(reading) == "gradient":
        return 1.0
    norm = squared_norm(gradient)
    return torch.where(norm > 0, 1 / norm, 0)


def credit(
    trace: Tensor,
    gradient: Tensor,
    td_error: Tensor,
    chosen_td_error: Tensor,
    decay: Tensor,
    scale: Tensor | float,
    goes_on: Tensor,
) -> tuple[Tensor, Tensor]:
    """Steps f, g and h of Table 1, for one tensor of weights.

        e ← γλe;   Δw = δe + δ′∇Q(s, a);   e ← e + scale·∇Q(s, a);   e ← 0 at an end

    The trace is not cut on an exploratory action: that is Peng's Q(λ).

    Args:
        trace: e, ``[*weights, runs]``.
        gradient: ∇Q(s, a), same shape.
        td_error: δ, ``[runs]``.
        chosen_td_error: δ′, ``[runs]``.
        decay: γλ, ``[runs]``.
        scale: of step h (:func:`step_h_scale`), ``[runs]``.
        goes_on: 1, or 0 where the episode has ended, also by truncation, ``[runs]``.

    Returns:
        Δw, to be multiplied by the step size α, and the new trace; both ``[*weights, runs]``.
    """
    direction = (td_error * decay) * trace + chosen_td_error * gradient
    return direction, (goes_on * decay) * trace + (goes_on * scale) * gradient


def decayed_step_size(alpha: Tensor, decay: Tensor, reward: Tensor) -> Tensor:
    """α ← decay·α where the reward was positive; all ``[runs]``.

    The paper: «we decreased α whenever the agent got reward», without a figure.
    """
    return torch.where(reward > 0, decay * alpha, alpha)
