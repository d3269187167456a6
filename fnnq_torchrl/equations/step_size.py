"""Rules for the step size α. The runs are the last dimension.

A step is α(δe + δ′∇Q(s, a)). Two rules, ``obgd`` and ``alpha_bound``, depend on its direction. They
use the trace including the present pair, z = γλe + ∇Q(s, a), which is the direction if both errors
are 1 (:meth:`.q_lambda.Rule.present_trace`). Watkins' and naive Q(λ) step along δ′z, as do the
learners of the two rules' sources. Peng's Q(λ) has two errors: ``obgd`` uses the larger. The
guarantee of ``alpha_bound`` holds for greedy actions, whose two errors are equal; for other actions
it is a rule of thumb.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

import torch
from torch import Tensor


@dataclass(frozen=True)
class Direction:
    """Functions that compute quantities of a step; only the rules that need them call them.

    Attributes:
        present_trace: returns z, tensors ``[*weights, runs]``.
        largest_error: returns the largest of the errors' absolute values, ``[runs]``.
        error_slope: returns ∇δ′ = γφ′ − φ with φ = ∇Q(s, a) and φ′ = ∇V(s′), shaped as z.
    """

    present_trace: Callable[[], Sequence[Tensor]]
    largest_error: Callable[[], Tensor]
    error_slope: Callable[[], Sequence[Tensor]]


class StepSize:
    """The paper's step size, unchanged within a step; :func:`decayed` lowers it after successes."""

    def start(self, alpha: Tensor) -> Tensor:
        """Return α before the first step, shaped as given."""
        return alpha.clone()

    def update(
        self, alpha: Tensor, kappa: Tensor | None, direction: Direction
    ) -> tuple[Tensor, Tensor]:
        """Return α for this step, and the α to keep for the next step.

        Args:
            alpha: the α kept from the last step, ``[runs]``.
            kappa: κ, ``[runs]``, needed by :func:`obgd` only.
            direction: the quantities of the step.

        Returns:
            Both α, each ``[runs]``.
        """
        return alpha, alpha


class ObGD(StepSize):
    """The step size that :func:`obgd` bounds for each step alone; the kept α stays the same."""

    def update(
        self, alpha: Tensor, kappa: Tensor | None, direction: Direction
    ) -> tuple[Tensor, Tensor]:
        if kappa is None:
            raise ValueError("ObGD needs kappa")
        error, trace = direction.largest_error(), direction.present_trace()
        return obgd(alpha, kappa, error, trace), alpha


class AlphaBound(StepSize):
    """The step size that :func:`alpha_bound` lowers for this and all later steps."""

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
    """Return the step size with the given name.

    Raises:
        ValueError: if there is no such step size.
    """
    if name not in STEP_SIZES:
        *others, last = STEP_SIZES
        raise ValueError(f"step_size={name!r}: must be {', '.join(others)} or {last}")
    return STEP_SIZES[name]()


def decayed(alpha: Tensor, decay: Tensor, success: Tensor) -> Tensor:
    """Return decay·α where ``success`` (bool) is true, and α elsewhere; all have one shape.

    The paper: «we decreased α whenever the agent got reward», without a figure. The paper's robot
    gets a reward when it catches the ball, which is a success.
    """
    return torch.where(success, decay * alpha, alpha)


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
    norm = _total(z.abs() for z in trace)
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
    along = _total(z * slope for z, slope in zip(trace, error_slope, strict=True))
    return torch.where(along < 0, torch.minimum(alpha, -1 / along), alpha)


def _total(tensors: Iterable[Tensor]) -> Tensor:
    """Return the sum over all weights: from tensors ``[*weights, runs]`` to ``[runs]``."""
    return reduce(torch.add, (x.flatten(0, -2).sum(0) for x in tensors))
