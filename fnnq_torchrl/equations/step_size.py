"""How large a step is along its direction. The runs are the last dimension.

Δw = α(δe + δ′∇Q(s, a)), and two rules look at that direction before they say what α is. They know
it by the trace with the present pair in it, z = γλe + ∇Q(s, a), which is Δw/α of a step whose two
errors are 1 (:func:`.q_lambda.present_trace`). Watkins' and naive Q(λ) go along δ′z, as
the learners of both sources do. Peng's has two errors. ``obgd`` takes the larger of them; what
``alpha_bound`` says of signs holds for a greedy action, which makes them the same, and else is a
rule of thumb.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from fnnq_torchrl.equations.names import STEP_SIZES


@dataclass(frozen=True)
class StepSize:
    """Which step size it is.

    * ``decay``, the paper's: α, multiplied by its decay after each catch; ``constant``: without.
    * ``obgd`` and ``alpha_bound``: that α, bounded by :func:`obgd` anew in each step or by
      :func:`alpha_bound` for good.

    Raises:
        ValueError: there is no such step size.
    """

    kind: str = "decay"

    def __post_init__(self) -> None:
        if self.kind not in STEP_SIZES:
            *others, last = STEP_SIZES
            raise ValueError(f"step_size={self.kind!r}: must be {', '.join(others)} or {last}")


def decayed(alpha: Tensor, decay: Tensor, reward: Tensor) -> Tensor:
    """α ← decay·α where the reward was positive; all ``[runs]``.

    The paper: «we decreased α whenever the agent got reward», without a figure.
    """
    return torch.where(reward > 0, decay * alpha, alpha)


def obgd(alpha: Tensor, kappa: Tensor, error: Tensor, trace: Sequence[Tensor]) -> Tensor:
    """The step size of overshooting-bounded gradient descent, ObGD.

        α / max(M, 1) with M = ακδ̄‖z‖₁, δ̄ = max(|δ|, 1)

    so that κδ̄‖z‖₁ times it is at most 1. M. Elsayed, G. Vasan, A. R. Mahmood, "Streaming deep
    reinforcement learning finally works", 2024, algorithm 3.

    Args:
        alpha: α, the largest step size, ``[runs]``.
        kappa: κ, ``[runs]``.
        error: |δ|, of several errors the largest, ``[runs]``.
        trace: z, tensors ``[*weights, runs]``.

    Returns:
        ``[runs]``.
    """
    norm = _total(z.abs() for z in trace)
    reach = alpha * kappa * error.clamp(min=1) * norm
    return alpha / reach.clamp(min=1)


def alpha_bound(alpha: Tensor, trace: Sequence[Tensor], error_slope: Sequence[Tensor]) -> Tensor:
    """The step size by the α bound: the largest so far that turned the sign of no TD error.

        α ← min(α, 1/|z·(γφ′ − φ)|) where z·(γφ′ − φ) < 0, with φ = ∇Q(s, a), φ′ = ∇V(s′)

    Where Q is linear, a step αδz makes (1 + αz·(γφ′ − φ))δ of the error δ. W. Dabney, A. G. Barto,
    "Adaptive step-size for online temporal difference learning", AAAI 2012.

    Args:
        alpha: α so far, ``[runs]``.
        trace: z, tensors ``[*weights, runs]``.
        error_slope: γφ′ − φ, which is ∇δ′, of each.

    Returns:
        ``[runs]``.
    """
    along = _total(z * slope for z, slope in zip(trace, error_slope, strict=True))
    return torch.where(along < 0, torch.minimum(alpha, -1 / along), alpha)


def _total(tensors: Iterable[Tensor]) -> Tensor:
    """The sum over all weights: from tensors ``[*weights, runs]`` to ``[runs]``."""
    return torch.stack([x.flatten(0, -2).sum(0) for x in tensors]).sum(0)
