"""One step of Q(λ) or Sarsa(λ) (paper, Table 1 and eq. 4, 5). The runs are the last dimension.

Source: J. Peng, R. J. Williams, "Incremental multi-step Q-learning", Machine Learning 22, 1996.
Two misprints of the paper are corrected. Table 1 f has Q̂ ← Q̂ + α·Tr; Peng and Williams have
Q̂ ← Q̂ + α·Tr·δ. V̂(s) is printed as arg max Q̂; it is max Q̂.
"""

from collections.abc import Sequence
from typing import NamedTuple

from torch import Tensor

from fnnq_torchrl.equations.traces import TRACES, Correction, Credit, Trace


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
        reward: r, any shape; the other tensors have this shape or broadcast to it.
        terminated: whether s′ ends the task (bool); V(s′) is then taken as 0.
        value: V(s) = max Q(s, ·).
        chosen_value: Q(s, a).
        next_value: V(s′): max Q(s′, ·), or the value that a variant of Sarsa uses instead.
        gamma: γ, the discount.

    Returns:
        δ and δ′, shaped as ``reward``.
    """
    target = reward + gamma * next_value.masked_fill(terminated, 0)
    return target - value, target - chosen_value


class Variant(NamedTuple):
    """A variant of Q(λ) or Sarsa(λ): its errors, and whether it cuts the trace.

    Attributes:
        past_gets_td_error: whether earlier pairs are updated with δ; else with δ′, the error of
            the present pair.
        cuts: whether the trace is cut before an action that isn't greedy.
        bootstrap: the value of the next state in both errors, a name in
            :data:`fnnq_torchrl.equations.names.BOOTSTRAPS`.
    """

    past_gets_td_error: bool
    cuts: bool
    bootstrap: str = "best"


VARIANTS = {
    "peng": Variant(past_gets_td_error=True, cuts=False),
    "watkins": Variant(past_gets_td_error=False, cuts=True),
    "naive": Variant(past_gets_td_error=False, cuts=False),
    "sarsa": Variant(past_gets_td_error=False, cuts=False, bootstrap="chosen"),
    "expected_sarsa": Variant(past_gets_td_error=False, cuts=False, bootstrap="expected"),
}
"""The variants by their names.

* ``peng``, the paper's: earlier pairs are updated with δ = r + γV(s′) − V(s), the present pair with
  δ′ = r + γV(s′) − Q(s, a). The trace is never cut.
* ``watkins``: all pairs are updated with δ′, and the trace is cut before an action that isn't
  greedy (C. J. C. H. Watkins, "Learning from delayed rewards", 1989; R. S. Sutton, A. G. Barto,
  "Reinforcement learning", 1998, fig. 7.14).
* ``naive``: Watkins' without the cut (Sutton & Barto, 1998, section 7.6).
* ``sarsa``: all pairs are updated with r + γQ(s′, a′) − Q(s, a). The action a′ is chosen before the
  update and taken in the next step, as in Sutton & Barto, 2018, section 12.7. In a world with one
  action, this variant is TD(λ).
* ``expected_sarsa``: as ``sarsa``, with the mean of Q(s′, ·) under the policy in place of Q(s′, a′)
  (H. van Seijen et al., "A theoretical and empirical analysis of expected Sarsa", ADPRL 2009).

All variants follow the order of Table 1. First e ← γλe. Then the weights change along e for the
earlier pairs and along ∇Q(s, a) for the present pair; both errors are from the weights before the
step. Step h then adds the present pair to e. Sutton & Barto add that pair first, then change the
weights along Δw = δ′e. Both orders give the same Δw, except with the trace ``output``: there the
present pair still contributes δ′∇Q(s, a), so that with λ = 0 every variant is Q-learning.
"""


class Rule:
    """A variant of Q(λ) with a trace.

    Args:
        variant: a name in :data:`VARIANTS`.
        trace: a name in :data:`fnnq_torchrl.equations.traces.TRACES`, or a trace.
        window: the number of steps that ``trace="window"`` keeps.

    Raises:
        ValueError: if there is no such variant or trace, the window that the trace needs is missing
            or below 1, or the trace ``corrects`` and the variant isn't ``sarsa``.
    """

    def __init__(
        self, variant: str = "peng", trace: str | Trace = "output", window: int | None = None
    ) -> None:
        for name, given, choices in (("variant", variant, VARIANTS), ("trace", trace, TRACES)):
            if isinstance(given, str) and given not in choices:
                *others, last = choices
                raise ValueError(f"{name}={given!r}: must be {', '.join(others)} or {last}")
        self.variant = VARIANTS[variant]
        self.trace = TRACES[trace].of(window) if isinstance(trace, str) else trace
        if self.trace.corrects and variant != "sarsa":
            raise ValueError(f"trace={trace!r}: needs variant='sarsa', not {variant!r}")

    def credit(
        self,
        td_error: Tensor,
        chosen_td_error: Tensor,
        decay: Tensor,
        greedy: Tensor | None,
        goes_on: Tensor,
        *,
        of_all: Sequence[Tensor] | None = None,
        correction: Correction | None = None,
    ) -> Credit:
        """Return the errors of a step, and the factors that decay, cut or clear the trace.

        Args:
            td_error, chosen_td_error: δ and δ′, ``[runs]``.
            decay: γλ, ``[runs]``.
            greedy: 1 where the action was greedy, else 0, ``[runs]``; None if the trace is never
                cut.
            goes_on: 0 where the episode has ended, also by truncation, else 1, ``[runs]``.
            of_all: ∇ΣQ(s, ·) over all actions for each tensor, if the trace ``clears``.
            correction: α and Q(s, a) − Q_old, if the trace ``corrects``.
        """
        past_error = td_error if self.variant.past_gets_td_error else chosen_td_error
        at_once = not self.variant.past_gets_td_error
        return Credit(
            past_error, chosen_td_error, decay, greedy, goes_on, at_once, of_all, correction
        )
