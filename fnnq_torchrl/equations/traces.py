"""The eligibility trace of Q(λ): steps f, g and h of the paper's Table 1. The runs come last.

A trace credits the earlier pairs of state and action. All classes have one form: `start` makes the
trace before the first step, `update` returns the direction Δw of a step and the trace after it. Δw
is multiplied by the step size α later.

The classes differ in step h, Tr(s, a) ← Tr(s, a) + 1: in its meaning for the trace e of a network
with the gradient f = ∇Q(s, a).
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import torch
from torch import Tensor


class Credit(NamedTuple):
    """The errors of a step, and the factors by which the trace fades before and after it.

    Attributes:
        past_error: the error of the earlier pairs, δ for Peng's Q(λ), ``[runs]``.
        present_error: the error of the present pair, δ′, ``[runs]``.
        decay: γλ, ``[runs]``.
        keeps: 0 where the trace is cut before the update, else 1, ``[runs]``; None if it is never
            cut.
        goes_on: 0 where the episode has ended, also by truncation, else 1, ``[runs]``.
        at_once: whether a replacing trace takes in ∇Q before Δw (Watkins, Δw = δ′e) or after it
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
            window: the number of steps that a finite window keeps; the other traces ignore it.
        """
        return cls()

    def start(self, weights: Tensor) -> Tensor:
        """Return the trace before the first step.

        Args:
            weights: ``[*weights, runs]``.

        Returns:
            Zeros of that shape; for a window, of as many times that shape.
        """
        return torch.zeros_like(weights)

    @abstractmethod
    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        """Return Δw of a step and the trace after it, for every tensor of weights.

        Args:
            traces: e of each tensor, in the shape that :meth:`start` gives it.
            gradients: f = ∇Q(s, a) of each, ``[*weights, runs]``.
            credit: the errors of the step.
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
        """Return the multiple of f that step h adds."""
        return 1.0


class OutputTrace(GradientTrace):
    """The paper to the letter: the trace network's output at (s, a) rises by one, e ← e + f/‖f‖².

    It rises by exactly one if Q is linear in the weights. Where f is zero, no change of e can raise
    it, and e stays.
    """

    def scale(self, gradients: Sequence[Tensor]) -> Tensor:
        norm = squared_norm(gradients)
        return torch.where(norm > 0, 1 / norm, 0)


class ReplacingTrace(Trace):
    """A replacing trace: e ← f wherever |f| ≥ |e|, else e stays.

    For a table it is that of S. P. Singh, R. S. Sutton, "Reinforcement learning with replacing
    eligibility traces", Machine Learning 22, 1996; for features other than 0 and 1, that of
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

    The gradients themselves are kept, the latest first, ``[window, *weights, runs]``. A running
    sum, with the latest added and the oldest subtracted, would build up rounding errors.

    Args:
        window: the number of gradients kept.

    Raises:
        ValueError: it is below 1.
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

For a table the first two are the same, and a window as long as the episode equals them.
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
    """Return the two errors, the decay (0 where the trace is cut) and ``goes_on``."""
    decay = credit.decay if credit.keeps is None else credit.decay * credit.keeps
    return credit.past_error, credit.present_error, decay, credit.goes_on
