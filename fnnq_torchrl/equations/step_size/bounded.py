"""Step sizes that are bounded by the direction of the step. The runs are the last dimension.

Both rules use z, the trace including the present pair (:class:`.base.Step`). Of the two errors of
Peng's Q(λ), ``obgd`` uses the larger. The guarantee of ``alpha_bound`` holds for greedy actions,
whose two errors are equal; for other actions it is a rule of thumb.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from .base import Numbers, State, Step, Stepped, StepSize, total


class ObGD(StepSize):
    """The step size that :func:`obgd` bounds for each step alone; the kept α stays the same."""

    numbers = ("kappa",)

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        size = obgd(alpha, numbers["kappa"], step.largest_error(), step.present_trace())
        return Stepped(step.credited(), [size] * len(step.gradients), alpha, state)


class AlphaBound(StepSize):
    """The step size that :func:`alpha_bound` lowers for this and all later steps."""

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        bounded = alpha_bound(alpha, step.present_trace(), step.error_slope())
        return Stepped(step.credited(), [bounded] * len(step.gradients), bounded, state)


def obgd(alpha: Tensor, kappa: Tensor, error: Tensor, trace: Sequence[Tensor]) -> Tensor:
    """Return the step size of overshooting-bounded gradient descent, ObGD.

        α / max(M, 1) with M = ακδ̄‖z‖₁, δ̄ = max(|δ|, 1)

    So the product of the step size and κδ̄‖z‖₁ is at most 1. Source: M. Elsayed, G. Vasan,
    A. R. Mahmood, "Streaming deep reinforcement learning finally works", 2024, algorithm 3.

    Args:
        alpha: α, the largest step size, ``[runs]``.
        kappa: κ, ``[runs]``.
        error: |δ|, the largest of the errors' absolute values, ``[runs]``.
        trace: z, tensors ``[*weights, runs]``.

    Returns:
        The step size, ``[runs]``.
    """
    norm = total([z.abs() for z in trace])
    reach = alpha * kappa * error.clamp(min=1) * norm
    return alpha / reach.clamp(min=1)


def alpha_bound(alpha: Tensor, trace: Sequence[Tensor], error_slope: Sequence[Tensor]) -> Tensor:
    """Return the largest α, at most the given one, that doesn't change the TD error's sign.

        α ← min(α, 1/|z·(γφ′ − φ)|) where z·(γφ′ − φ) < 0, with φ = ∇Q(s, a), φ′ = ∇V(s′)

    If Q is linear, a step αδz changes the error δ to (1 + αz·(γφ′ − φ))δ. Source: W. Dabney,
    A. G. Barto, "Adaptive step-size for online temporal difference learning", AAAI 2012.

    Args:
        alpha: α so far, ``[runs]``.
        trace: z, tensors ``[*weights, runs]``.
        error_slope: ∇δ′ = γφ′ − φ, shaped as z.

    Returns:
        The new α, ``[runs]``.
    """
    along = total([z * slope for z, slope in zip(trace, error_slope, strict=True)])
    return torch.where(along < 0, torch.minimum(alpha, -1 / along), alpha)
