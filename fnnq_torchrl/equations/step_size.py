"""Rules for the step size α. The runs are the last dimension.

A step is α(δe + δ′∇Q(s, a)), and two of the rules look at its direction first. They get the trace
with the present pair in it, z = γλe + ∇Q(s, a), which is the direction for two errors of 1
(:meth:`.q_lambda.Rule.present_trace`). Watkins' and naive Q(λ) go along δ′z, as the learners of
both sources do. Peng's has two errors: ``obgd`` takes the larger one. The guarantee of
``alpha_bound`` holds for a greedy action, where both are equal; otherwise it is a rule of thumb.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Direction:
    """Quantities of a step, computed only for the rules that need them.

    Attributes:
        present_trace: returns z, tensors ``[*weights, runs]``.
        largest_error: returns |δ|, the largest of the errors, ``[runs]``.
        error_slope: returns ∇δ′ = γφ′ − φ with φ = ∇Q(s, a), φ′ = ∇V(s′), shaped as z.
    """

    present_trace: Callable[[], Sequence[Tensor]]
    largest_error: Callable[[], Tensor]
    error_slope: Callable[[], Sequence[Tensor]]


class StepSize:
    """The paper's step size: α, multiplied by its decay after each success; 1 keeps it constant."""

    def start(self, alpha: Tensor) -> Tensor:
        """Return α before the first step, in the shape given."""
        return alpha.clone()

    def update(
        self, alpha: Tensor, kappa: Tensor | None, direction: Direction
    ) -> tuple[Tensor, Tensor]:
        """Return α for this step, and α to go on with.

        Args:
            alpha: α so far, ``[runs]``.
            kappa: κ of :func:`obgd`, ``[runs]``.
            direction: the quantities of the step.

        Returns:
            Each ``[runs]``.
        """
        return alpha, alpha


class ObGD(StepSize):
    """α bounded in every step by :func:`obgd`; the bound isn't kept."""

    def update(
        self, alpha: Tensor, kappa: Tensor | None, direction: Direction
    ) -> tuple[Tensor, Tensor]:
        if kappa is None:
            raise ValueError("ObGD needs kappa")
        error, trace = direction.largest_error(), direction.present_trace()
        return obgd(alpha, kappa, error, trace), alpha


class AlphaBound(StepSize):
    """α that never rises: the :func:`alpha_bound` of each step is kept."""

    def update(
        self, alpha: Tensor, kappa: Tensor | None, direction: Direction
    ) -> tuple[Tensor, Tensor]:
        bounded = alpha_bound(alpha, direction.present_trace(), direction.error_slope())
        return bounded, bounded


STEP_SIZES: dict[str, type[StepSize]] = {
    "decay": StepSize,
    "constant": StepSize,  # with a decay of 1
    "obgd": ObGD,
    "alpha_bound": AlphaBound,
}
"""The step sizes by their names (:data:`fnnq_torchrl.equations.names.STEP_SIZES`)."""


def make_step_size(name: str) -> StepSize:
    """Return the step size of that name.

    Raises:
        ValueError: there is none.
    """
    if name not in STEP_SIZES:
        *others, last = STEP_SIZES
        raise ValueError(f"step_size={name!r}: must be {', '.join(others)} or {last}")
    return STEP_SIZES[name]()


def decayed(alpha: Tensor, decay: Tensor, success: Tensor) -> Tensor:
    """Return decay·α where an episode has succeeded (bool), and α elsewhere; all ``[runs]``.

    The paper: «we decreased α whenever the agent got reward», without a figure. Its robot gets a
    reward when it catches the ball.
    """
    return torch.where(success, decay * alpha, alpha)


def obgd(alpha: Tensor, kappa: Tensor, error: Tensor, trace: Sequence[Tensor]) -> Tensor:
    """Return the step size of overshooting-bounded gradient descent, ObGD.

        α / max(M, 1) with M = ακδ̄‖z‖₁, δ̄ = max(|δ|, 1)

    so its product with κδ̄‖z‖₁ is at most 1. M. Elsayed, G. Vasan, A. R. Mahmood, "Streaming deep
    reinforcement learning finally works", 2024, algorithm 3.

    Args:
        alpha: α, the largest step size, ``[runs]``.
        kappa: κ, ``[runs]``.
        error: |δ|, the largest of the errors, ``[runs]``.
        trace: z, tensors ``[*weights, runs]``.

    Returns:
        ``[runs]``.
    """
    norm = _total(z.abs() for z in trace)
    reach = alpha * kappa * error.clamp(min=1) * norm
    return alpha / reach.clamp(min=1)


def alpha_bound(alpha: Tensor, trace: Sequence[Tensor], error_slope: Sequence[Tensor]) -> Tensor:
    """Return the largest α that would have turned the sign of no TD error so far.

        α ← min(α, 1/|z·(γφ′ − φ)|) where z·(γφ′ − φ) < 0, with φ = ∇Q(s, a), φ′ = ∇V(s′)

    With a linear Q, a step αδz changes the error δ to (1 + αz·(γφ′ − φ))δ. W. Dabney, A. G. Barto,
    "Adaptive step-size for online temporal difference learning", AAAI 2012.

    Args:
        alpha: α so far, ``[runs]``.
        trace: z, tensors ``[*weights, runs]``.
        error_slope: ∇δ′ = γφ′ − φ, shaped as z.

    Returns:
        ``[runs]``.
    """
    along = _total(z * slope for z, slope in zip(trace, error_slope, strict=True))
    return torch.where(along < 0, torch.minimum(alpha, -1 / along), alpha)


def _total(tensors: Iterable[Tensor]) -> Tensor:
    """Return the sum over all weights: from tensors ``[*weights, runs]`` to ``[runs]``."""
    return torch.stack([x.flatten(0, -2).sum(0) for x in tensors]).sum(0)
