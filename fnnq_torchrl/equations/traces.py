"""The eligibility trace of Q(λ): steps f, g and h of the paper's Table 1. The runs come last.

A trace assigns credit to earlier pairs of state and action. All classes have the same methods:
`start` makes the trace before the first step; `update` returns the direction Δw of a step and the
trace after the step. The caller multiplies Δw by the step size α.

Here e is the trace of a network's weights, and f = ∇Q(s, a). The classes differ in how step h,
Tr(s, a) ← Tr(s, a) + 1, changes e.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from functools import reduce
from typing import ClassVar, NamedTuple, Self

import torch
from torch import Tensor


class Correction(NamedTuple):
    """The inputs of a dutch trace besides the errors, each ``[runs]``.

    Attributes:
        alpha: the step size α of this step.
        change: Q(s, a) − Q_old, where Q_old is the value of the same pair before the last update,
            when the pair was (s′, a′); any number in the first step of an episode.
    """

    alpha: Tensor
    change: Tensor


class Credit(NamedTuple):
    """The errors of a step, and the factors that decay, cut or clear the trace.

    Attributes:
        past_error: the error for earlier pairs, ``[runs]``; δ in Peng's Q(λ).
        present_error: the error for the present pair, δ′, ``[runs]``.
        decay: γλ, ``[runs]``.
        keeps: 0 where the trace is cut before the update, else 1, ``[runs]``; None if the variant
            never cuts the trace.
        goes_on: 0 where the episode has ended, also by truncation, else 1, ``[runs]``.
        at_once: whether a replacing trace adds the present pair before Δw is computed, Δw = δ′e
            (Watkins), or afterwards, Δw = δe + δ′f (Table 1).
        of_all: ∇ΣQ(s, ·) over all actions for each tensor of weights, ``[*weights, runs]``; None
            unless the trace ``clears``.
        correction: α and Q(s, a) − Q_old; None unless the trace ``corrects``.
    """

    past_error: Tensor
    present_error: Tensor
    decay: Tensor
    keeps: Tensor | None
    goes_on: Tensor
    at_once: bool
    of_all: Sequence[Tensor] | None = None
    correction: Correction | None = None

    @property
    def fading(self) -> Tensor:
        """γλ, and 0 where the trace is cut before the update, ``[runs]``."""
        return self.decay if self.keeps is None else self.decay * self.keeps


Credited = list[tuple[Tensor, Tensor]]
"""The direction Δw and the new trace, for each tensor of weights."""


class Trace(ABC):
    """The base class of all traces.

    Attributes:
        clears: whether :meth:`update` needs ``Credit.of_all``.
        corrects: whether :meth:`update` needs ``Credit.correction``.
    """

    clears: ClassVar[bool] = False
    corrects: ClassVar[bool] = False

    @classmethod
    def of(cls, window: int | None) -> Self:
        """Make a trace of this class.

        Args:
            window: the number of steps kept, for :class:`WindowTrace`; other traces ignore it.
        """
        return cls()

    def start(self, weights: Tensor) -> Tensor:
        """Return the trace before the first step.

        Args:
            weights: ``[*weights, runs]``.

        Returns:
            Zeros, shaped as ``weights``; a window has the shape ``[window, *weights, runs]``.
        """
        return torch.zeros_like(weights)

    @abstractmethod
    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        """Return Δw of a step and the trace after it, for every tensor of weights.

        Args:
            traces: e of each tensor, in the shape that :meth:`start` gives it.
            gradients: f = ∇Q(s, a) for each tensor, ``[*weights, runs]``.
            credit: the errors and factors of the step.
        """


class GradientTrace(Trace):
    """The usual semi-gradient trace, whose step h is e ← e + f.

    e ← γλe;   Δw = δe + δ′f;   e ← e + scale·f (scale = 1);   e ← 0 at the end of an episode
    """

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        past, present, goes_on = credit.past_error, credit.present_error, credit.goes_on
        decay = credit.fading
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
    """The trace that follows the paper to the letter, e ← e + f/‖f‖².

    So the trace network's output at (s, a) rises by one; exactly, if Q is linear in the weights. If
    f is zero, no change of e can raise the output, so e isn't changed.
    """

    def scale(self, gradients: Sequence[Tensor]) -> Tensor:
        norm = squared_norm(gradients)
        return torch.where(norm > 0, norm.reciprocal(), 0)


class ReplacingTrace(Trace):
    """A replacing trace: after e ← γλe, e becomes f wherever |f| ≥ |e|.

    Sources: for tables, S. P. Singh, R. S. Sutton, "Reinforcement learning with replacing
    eligibility traces", Machine Learning 22, 1996; for features other than 0 and 1,
    K. Främling, "Replacing eligibility trace for action-value learning with function
    approximation", ESANN 2007.
    """

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        past, present, goes_on = credit.past_error, credit.present_error, credit.goes_on
        decay = credit.fading
        credited = []
        of_all = gradients if credit.of_all is None else credit.of_all
        for e, f, all_ in zip(traces, gradients, of_all, strict=True):
            faded = decay * e
            replaced = self.replaced(faded, f, all_)
            direction = present * replaced if credit.at_once else past * faded + present * f
            credited.append((direction, goes_on * replaced))
        return credited

    def replaced(self, faded: Tensor, f: Tensor, of_all: Tensor) -> Tensor:
        """Return e with the present pair, ``[*weights, runs]``.

        Args:
            faded: γλe.
            f: ∇Q(s, a).
            of_all: ∇ΣQ(s, ·), for a trace that ``clears``.
        """
        return torch.where(f.abs() >= faded.abs(), f, faded)


class ClearingTrace(ReplacingTrace):
    """A replacing trace that is also set to 0 at the features of the other actions in s.

    It is meant for features that are 0 or 1, as in a table or tiles. Source: Singh & Sutton, 1996,
    section 5; R. S. Sutton, A. G. Barto, "Reinforcement learning", 2018, section 12.7.
    """

    clears = True

    def replaced(self, faded: Tensor, f: Tensor, of_all: Tensor) -> Tensor:
        return torch.where(of_all != 0, f, faded)


class DutchTrace(Trace):
    """The trace of true online Sarsa(λ), and of true online TD(λ).

        z = γλe + (1 − αγλ e·f)f;   Δw = (δ′ + Q − Q_old)z − (Q − Q_old)f;   e ← z

    If Q is linear in the weights, the weights after each step are those of the online λ-return
    algorithm. Source: H. van Seijen, A. R. Mahmood, P. M. Pilarski, M. C. Machado, R. S. Sutton,
    "True online temporal-difference learning", JMLR 17, 2016.
    """

    corrects = True

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        if credit.correction is None:
            raise ValueError("a dutch trace needs a correction, so α must be known beforehand")
        alpha, change = credit.correction
        error, decay, goes_on = credit.present_error, credit.fading, credit.goes_on
        pairs = [*zip(traces, gradients, strict=True)]
        overlap = torch.stack([(e * f).flatten(0, -2).sum(0) for e, f in pairs]).sum(0)
        share = 1 - alpha * decay * overlap
        credited = []
        for e, f in pairs:
            z = decay * e + share * f
            credited.append(((error + change) * z - change * f, goes_on * z))
        return credited


class WindowTrace(Trace):
    """A trace that keeps the last steps only.

    It is the paper's «finite-time window, which stores only some previous steps»:

        Δw = δΣ(γλ)ᵏfₖ + δ′f,   fₖ the gradient k steps ago, k from 1 to the window

    The trace is the last gradients, the latest first, ``[window, *weights, runs]``. A running sum
    that adds the latest and subtracts the oldest would accumulate rounding errors.

    Args:
        window: the number of gradients kept.

    Raises:
        ValueError: if the window is below 1.
    """

    def __init__(self, window: int) -> None:
        if window < 1:
            raise ValueError(f"window={window}: must be at least 1")
        self._window = window

    @classmethod
    def of(cls, window: int | None) -> Self:
        if window is None:
            raise ValueError("trace='window': needs window, the number of steps that it keeps")
        return cls(window)

    def start(self, weights: Tensor) -> Tensor:
        return weights.new_zeros(self._window, *weights.shape)

    def update(
        self, traces: Sequence[Tensor], gradients: Sequence[Tensor], credit: Credit
    ) -> Credited:
        past, present, decay, keeps, goes_on, *_ = credit
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
    "clearing": ClearingTrace,
    "dutch": DutchTrace,
}
"""The traces by their names (:data:`fnnq_torchrl.equations.names.TRACES`).

For a table, ``output`` and ``gradient`` are the same, and so is a window as long as the episode.
"""


def squared_norm(gradients: Iterable[Tensor]) -> Tensor:
    """Return ‖∇Q‖² of each run, over all weights of the run.

    Args:
        gradients: tensors ``[*weights, runs]``.

    Returns:
        ‖∇Q‖², ``[runs]``.
    """
    return reduce(torch.add, (f.square().flatten(0, -2).sum(0) for f in gradients))
