"""One step of Q(λ) (paper, Table 1 and eq. 4, 5). The runs are the last dimension.

Source: J. Peng, R. J. Williams, "Incremental multi-step Q-learning", Machine Learning 22, 1996.
Two misprints of the paper are mended: its Table 1 f has Q̂ ← Q̂ + α·Tr for Peng and Williams'
Q̂ ← Q̂ + α·Tr·δ, and its V̂(s) is arg max Q̂ for max Q̂.
"""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from fnnq_torchrl.equations.traces import TRACES, Credit, Credited


def td_errors(
    reward: Tensor,
    terminated: Tensor,
    value: Tensor,
    chosen_value: Tensor,
    next_value: Tensor,
    gamma: Tensor,
) -> tuple[Tensor, Tensor]:
    """Return δ = r + γV(s′) − V(s) and δ′ = r + γV(s′) − Q(s, a) (paper, eq. 4, 5).

    Args:
        reward: r, any shape; the others have the same or broadcast to it.
        terminated: bool; where s′ is an end, V(s′) counts as 0.
        value: V(s) = max Q(s, ·).
        chosen_value: Q(s, a).
        next_value: V(s′) = max Q(s′, ·).
        gamma: γ, the discount.

    Returns:
        δ and δ′, both from the weights before the update.
    """
    target = reward + gamma * next_value.masked_fill(terminated, 0)
    return target - value, target - chosen_value


class Variant(NamedTuple):
    """A variant of Q(λ).

    Attributes:
        past_gets_td_error: whether the earlier pairs of state and action get δ; else they get δ′,
            as the present pair does.
        cuts: whether the trace is cut before an action that isn't greedy.
    """

    past_gets_td_error: bool
    cuts: bool


VARIANTS = {
    "peng": Variant(past_gets_td_error=True, cuts=False),
    "watkins": Variant(past_gets_td_error=False, cuts=True),
    "naive": Variant(past_gets_td_error=False, cuts=False),
}
"""The variants by their names.

* ``peng``, the paper's: the earlier pairs get δ = r + γV(s′) − V(s), the present one δ′ = r +
  γV(s′) − Q(s, a). The trace is never cut.
* ``watkins``: all pairs get δ′, and the trace is cut before an action that isn't greedy
  (C. J. C. H. Watkins, "Learning from delayed rewards", 1989; R. S. Sutton, A. G. Barto,
  "Reinforcement learning", 1998, fig. 7.14).
* ``naive``: Watkins' without the cut (Sutton & Barto, 1998, section 7.6).

All keep the order of Table 1: e ← γλe; then the earlier pairs change along e and the present one
along ∇Q(s, a), from the weights before the step; then step h. Sutton & Barto put the present pair
into e first, and then change along Δw = δ′e. That is the same Δw except with the trace ``output``:
here the present pair still gets δ′∇Q(s, a), so that with λ = 0 every variant is Q-learning.
"""


class Rule:
    """A variant of Q(λ) with a trace.

    Args:
        variant: a name in :data:`VARIANTS`.
        trace: a name in :data:`fnnq_torchrl.equations.traces.TRACES`.
        window: the number of steps that ``trace="window"`` keeps.

    Raises:
        ValueError: there is no such variant or trace, or the window is missing or below 1.
    """

    def __init__(
        self, variant: str = "peng", trace: str = "output", window: int | None = None
    ) -> None:
        for name, given, choices in (("variant", variant, VARIANTS), ("trace", trace, TRACES)):
            if given not in choices:
                *others, last = choices
                raise ValueError(f"{name}={given!r}: must be {', '.join(others)} or {last}")
        self.variant = VARIANTS[variant]
        self.trace = TRACES[trace].of(window)

    def update(
        self,
        traces: Sequence[Tensor],
        gradients: Sequence[Tensor],
        td_error: Tensor,
        chosen_td_error: Tensor,
        decay: Tensor,
        greedy: Tensor | None,
        goes_on: Tensor,
    ) -> Credited:
        """Return Δw and the new trace for every tensor of weights.

        Args:
            traces: e of each tensor, in the shape that the trace's ``start`` gives it.
            gradients: ∇Q(s, a) of each, ``[*weights, runs]``.
            td_error, chosen_td_error: δ and δ′, ``[runs]``.
            decay: γλ, ``[runs]``.
            greedy: 1 where the action was greedy, else 0, ``[runs]``, for a variant that cuts.
            goes_on: 1, or 0 where the episode has ended, also by truncation, ``[runs]``.
        """
        past_error = td_error if self.variant.past_gets_td_error else chosen_td_error
        at_once = not self.variant.past_gets_td_error
        credit = Credit(past_error, chosen_td_error, decay, greedy, goes_on, at_once)
        return self.trace.update(traces, gradients, credit)

    def present_trace(
        self,
        traces: Sequence[Tensor],
        gradients: Sequence[Tensor],
        decay: Tensor,
        greedy: Tensor | None,
    ) -> list[Tensor]:
        """Return z, the trace with the present pair in it, which is Δw for two errors of 1.

            z = γλe + ∇Q(s, a),  or as the kind of trace combines them

        Args:
            traces, gradients, decay, greedy: as in :meth:`update`.

        Returns:
            z of each tensor of weights, ``[*weights, runs]``.
        """
        one = torch.ones_like(decay)
        return [z for z, _ in self.update(traces, gradients, one, one, decay, greedy, one)]

    def largest_error(self, td_error: Tensor, chosen_td_error: Tensor) -> Tensor:
        """Return the larger absolute value of the two errors, of those that the variant uses.

        Args:
            td_error, chosen_td_error: δ and δ′, any shape.

        Returns:
            max(|δ|, |δ′|) or, for a variant without δ, |δ′|.
        """
        past_error = td_error if self.variant.past_gets_td_error else chosen_td_error
        return torch.maximum(past_error.abs(), chosen_td_error.abs())
