"""The eligibility trace of Q(λ): steps f, g and h of the paper's Table 1. The runs come last.

A trace credits the pairs of state and action that came before. All classes have one form: `start`
makes the trace of weights before the first step, `update` gives the direction Δw of a step and the
trace after it. Δw is multiplied by the step size α later.

What step h, Tr(s, a) ← Tr(s, a) + 1, does to the trace e of a network, with f = ∇Q(s, a), is what
they differ in.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import torch
from torch import Tensor


class Credit(NamedTuple):
    """The errors of a step, and how the trace fades before and after it.

    Attributes:
        past_error: what the earlier pairs get, δ for Peng's Q(λ), ``[runs]``.
        present_error: what the present pair gets, δ′, ``[runs]``.
        decay: γλ, ``[runs]``.
        keeps: 0 where the trace is cut before the update, else 1, ``[runs]``; None if it is never
            cut.
        goes_on: 1, or 0 where the episode has ended, also by truncation, ``[runs]``.
        at_once: whether a replacing trace takes in ∇Q before Δw (Watkins, Δw = δ′e) or after
            (Table 1, Δw = δe + δ′f).
    """

    past_error: Tensor
    present_error: Tensor
    decay: Tensor
    keeps: Tensor | None
    goes_on: Tensor
    at_once: bool


Credited = list[tuple[Tensor, Tensor]]
"""For each tensor of weights, the direction Δw and the new trace."""


class Trace(ABC):
    """The interface of every trace."""

    @classmethod
    def of(cls, window: int | None) -> Self:
        """Make the trace.

        Args:
            window: the steps that a finite window keeps; no other trace has one.
        """
        return cls()

    def start(self, weights: Tensor) -> Tensor:
        """Return the trace before the first step.

        Args:
            weights: ``[*weights, runs]``.

        Returns:
            Zeros, of that shape unless the class says otherwise.
        """
        return torch.zeros_like(weights)

    @abstractmethod
    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        """Return Δw and the trace after a step, of all tensors of weights.

        Args:
            traces: e of each tensor, as :meth:`start` has it.
            gradients: f = ∇Q(s, a) of each, ``[*weights, runs]``.
            credit: what the step hands out.
        """


class GradientTrace(Trace):
    """Today's semi-gradient trace: e ← e + f.

    e ← γλe;   Δw = δe + δ′f;   e ← e + scale·f;   e ← 0 at an end
    """

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        past, present, decay, goes_on = _faded(credit)
        scale = self.scale(gradients)
        return [
            (
                (past * decay) * e + present * f,
                (goes_on * decay) * e + (goes_on * scale) * f,
            )
            for e, f in zip(traces, gradients, strict=True)
        ]

    def scale(self, gradients: Sequence[Tensor]) -> Tensor | float:
        """Return what step h adds, as a multiple of f."""
        return 1.0


class OutputTrace(GradientTrace):
    """The paper to the letter: the trace network's output at (s, a) rises by one, e ← e + f/‖f‖².

    Exactly by one where Q is linear in the weights; not at all where f is zero, and nothing can
    make it.
    """

    def scale(self, gradients: Sequence[Tensor]) -> Tensor:
        norm = squared_norm(gradients)
        return torch.where(norm > 0, 1 / norm, 0)


class ReplacingTrace(Trace):
    """A trace that is replaced: e ← f wherever |f| is no less than |e|, else e.

    For a table, that of S. P. Singh, R. S. Sutton, "Reinforcement learning with replacing
    eligibility traces", Machine Learning 22, 1996; for features that are no mere 0 and 1, of
    K. Främling, "Replacing eligibility trace for action-value learning with function
    approximation", ESANN 2007.
    """

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        past, present, decay, goes_on = _faded(credit)
        credited = []
        for e, f in zip(traces, gradients, strict=True):
            faded = decay * e
            replaced = torch.where(f.abs() >= faded.abs(), f, faded)
            direction = present * replaced if credit.at_once else past * faded + present * f
            credited.append((direction, goes_on * replaced))
        return credited


class WindowTrace(Trace):
    """The paper's «finite-time window, which stores only some previous steps».

        Δw = δΣ(γλ)ᵏfₖ + δ′f,   fₖ the gradient k steps ago, k from 1 to the window

    The gradients themselves are kept, the latest first, ``[window, *weights, runs]``. So no
    rounding builds up, as it would in a sum to which the latest is added and from which the oldest
    is taken.

    Args:
        window: how many there are.

    Raises:
        ValueError: there is none.
    """

    def __init__(self, window: int) -> None:
        if window < 1:
            raise ValueError(f"window={window}: must be at least 1")
        self._window = window

    @classmethod
    def of(cls, window: int | None) -> Self:
        if window is None:
            raise ValueError("trace='window': needs a window, its number of steps")
        return cls(window)

    def start(self, weights: Tensor) -> Tensor:
        return weights.new_zeros(self._window, *weights.shape)

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        past, present, decay, keeps, goes_on, _ = credit
        kept = 1.0 if keeps is None else keeps
        credited = []
        for earlier, f in zip(traces, gradients, strict=True):
            faded = torch.zeros_like(f)
            for before in reversed(earlier.unbind(0)):
                faded = decay * (faded + before)
            direction = (past * kept) * faded + present * f
            left = (goes_on * kept) * earlier[:-1]
            credited.append((direction, torch.cat([(goes_on * f).unsqueeze(0), left])))
        return credited


TRACES: dict[str, type[Trace]] = {
    "output": OutputTrace,
    "gradient": GradientTrace,
    "replacing": ReplacingTrace,
    "window": WindowTrace,
}
"""The traces by their names (:data:`fnnq_torchrl.equations.names.TRACES`).

For a table the first two are the same, and so is a window as long as the episode.
"""


def squared_norm(gradients: Iterable[Tensor]) -> Tensor:
    """Return ‖∇Q‖² of each run over all its weights.

    Args:
        gradients: tensors ``[*weights, runs]``.

    Returns:
        ``[runs]``.
    """
    return torch.stack([f.square().flatten(0, -2).sum(0) for f in gradients]).sum(0)


def _faded(credit: Credit) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return the credit with a decay of 0 where the trace is cut."""
    decay = credit.decay if credit.keeps is None else credit.decay * credit.keeps
    return credit.past_error, credit.present_error, decay, credit.goes_on
