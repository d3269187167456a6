"""Q(λ), one step of it (paper, Table 1 and eq. 4, 5). The runs are the last dimension.

Source: J. Peng, R. J. Williams, "Incremental multi-step Q-learning", Machine Learning 22, 1996.
The paper's Table 1 f prints Q̂ ← Q̂ + α·Tr; as in Peng & Williams it is Q̂ ← Q̂ + α·Tr·δ. Its V̂(s)
is printed as arg max Q̂; it is the max.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from fnnq_torchrl.equations.names import TRACES, VARIANTS


@dataclass(frozen=True)
class Rule:
    """Which Q(λ) it is.

    * ``peng``, the paper's: the earlier pairs get δ = r + γV(s′) − V(s), the present one δ′ = r +
      γV(s′) − Q(s, a). The trace is never cut.
    * ``watkins``: all pairs get δ′, and the trace is cut before an action that is not greedy: what
      came before it is not to answer for what comes after (C. J. C. H. Watkins, "Learning from
      delayed rewards", 1989; R. S. Sutton, A. G. Barto, "Reinforcement learning", 1998, fig. 7.14).
    * ``naive``: Watkins' without the cut (Sutton & Barto, 1998, section 7.6).

    All keep the order of Table 1: e ← γλe; the earlier pairs by e and the present one by ∇Q(s, a),
    from the weights before the step; then step h. Sutton & Barto have the present pair in e before
    Δw = δ′e: the same Δw, but for ``output``, where the present pair still gets δ′∇Q(s, a), so that
    λ = 0 is Q-learning whatever the variant.

    What step h, Tr(s, a) ← Tr(s, a) + 1, does to the trace e of a network, with f = ∇Q(s, a):

    * ``output``, the paper to the letter: the trace *network's output* at (s, a) rises by one, e ←
      e + f/‖f‖². (Exactly by one where Q is linear in the weights; not at all where f is zero, and
      nothing can make it.)
    * ``gradient``, today's semi-gradient traces: e ← e + f.
    * ``replacing``: e ← f wherever |f| is no less than |e|, else e. For a table that is the trace
      of S. P. Singh, R. S. Sutton, "Reinforcement learning with replacing eligibility traces",
      Machine Learning 22, 1996; for features that are no mere 0 and 1, of K. Främling, "Replacing
      eligibility trace for action-value learning with function approximation", ESANN 2007.
    * ``window``, the paper's «finite-time window, which stores only some previous steps»: e is the
      sum of the last ``window`` gradients, each times (γλ)ᵏ, k steps later.

    For a table the first two are the same, and so is a window as long as the episode.

    Args:
        variant: ``peng``, ``watkins`` or ``naive``.
        trace: ``output``, ``gradient``, ``replacing`` or ``window``.
        window: the steps that a window has.

    Raises:
        ValueError: there is no such variant or trace, or the window has no step.
    """

    variant: str = "peng"
    trace: str = "output"
    window: int = 1

    def __post_init__(self) -> None:
        for name, choices in (("variant", VARIANTS), ("trace", TRACES)):
            if getattr(self, name) not in choices:
                *others, last = choices
                raise ValueError(
                    f"{name}={getattr(self, name)!r}: must be {', '.join(others)} or {last}"
                )
        if self.window < 1:
            raise ValueError(f"window={self.window}: must be at least 1")

    def no_trace(self, weights: Tensor) -> Tensor:
        """The trace before the first step, for weights of the shape ``[*weights, runs]``.

        Returns:
            Zeros of that shape; for a window ``[window, *weights, runs]``, its gradients, the
            latest first.
        """
        steps = (self.window,) if self.trace == "window" else ()
        return weights.new_zeros(*steps, *weights.shape)


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


def step_h_scale(gradient: Iterable[Tensor], trace: str) -> Tensor | float:
    """What step h adds to a trace that sums up, as a multiple of ∇Q(s, a).

    Args:
        gradient: ∇Q(s, a), tensors ``[*weights, runs]``.
        trace: of a :class:`Rule`.

    Returns:
        1/‖∇Q‖², ``[runs]``, for ``output`` (0 where ∇Q is); else 1.
    """
    if trace != "output":
        return 1.0
    norm = squared_norm(gradient)
    return torch.where(norm > 0, 1 / norm, 0)


def credit(
    trace: Tensor,
    gradient: Tensor,
    past_error: Tensor,
    present_error: Tensor,
    decay: Tensor,
    scale: Tensor | float,
    goes_on: Tensor,
) -> tuple[Tensor, Tensor]:
    """Steps f, g and h of Table 1 for a trace that sums up, and for one tensor of weights.

        e ← γλe;   Δw = δe + δ′∇Q(s, a);   e ← e + scale·∇Q(s, a);   e ← 0 at an end

    Args:
        trace: e, ``[*weights, runs]``.
        gradient: ∇Q(s, a), same shape.
        past_error: what the earlier pairs get, δ for Peng's Q(λ), ``[runs]``.
        present_error: what the present pair gets, δ′, ``[runs]``.
        decay: γλ, 0 where the trace is cut, ``[runs]``.
        scale: of step h (:func:`step_h_scale`), ``[runs]``.
        goes_on: 1, or 0 where the episode has ended, also by truncation, ``[runs]``.

    Returns:
        Δw, to be multiplied by the step size α, and the new trace; both ``[*weights, runs]``.
    """
    direction = (past_error * decay) * trace + present_error * gradient
    return direction, (goes_on * decay) * trace + (goes_on * scale) * gradient


def credit_replacing(
    trace: Tensor,
    gradient: Tensor,
    past_error: Tensor,
    present_error: Tensor,
    decay: Tensor,
    goes_on: Tensor,
    *,
    at_once: bool,
) -> tuple[Tensor, Tensor]:
    """The same for a replacing trace: e ← ∇Q(s, a) wherever that is no less, by absolute values.

    Args:
        trace, gradient, past_error, present_error, decay, goes_on: as in :func:`credit`.
        at_once: the trace is replaced before it is used, as Watkins' Q(λ) has it, Δw = δ′e; by
            Table 1 it is after, Δw = δe + δ′∇Q(s, a).

    Returns:
        As :func:`credit`.
    """
    faded = decay * trace
    replaced = torch.where(gradient.abs() >= faded.abs(), gradient, faded)
    if at_once:
        direction = present_error * replaced
    else:
        direction = past_error * faded + present_error * gradient
    return direction, goes_on * replaced


def credit_window(
    gradients: Tensor,
    gradient: Tensor,
    past_error: Tensor,
    present_error: Tensor,
    decay: Tensor,
    keeps: Tensor | float,
    goes_on: Tensor,
) -> tuple[Tensor, Tensor]:
    """The same for a window: Δw = δΣ(γλ)ᵏ∇Q(s₋ₖ, a₋ₖ) + δ′∇Q(s, a), k from 1 to the window.

    The gradients themselves are kept, so no rounding builds up, as it would in a sum to which the
    latest is added and from which the oldest is taken.

    Args:
        gradients: of the last steps, the latest first, ``[window, *weights, runs]``.
        gradient: ∇Q(s, a), ``[*weights, runs]``.
        past_error, present_error, goes_on: as in :func:`credit`.
        decay: γλ, ``[runs]``.
        keeps: 1, or 0 where the trace is cut, ``[runs]``.

    Returns:
        Δw, ``[*weights, runs]``, and the new gradients.
    """
    faded = torch.zeros_like(gradient)
    for earlier in reversed(gradients.unbind(0)):
        faded = decay * (faded + earlier)
    direction = (past_error * keeps) * faded + present_error * gradient
    kept = (goes_on * keeps) * gradients[:-1]
    return direction, torch.cat([(goes_on * gradient).unsqueeze(0), kept])


def _errors(rule: Rule, td_error: Tensor, chosen_td_error: Tensor) -> tuple[Tensor, Tensor]:
    """What the earlier pairs and the present one get."""
    return td_error if rule.variant == "peng" else chosen_td_error, chosen_td_error


def credit_all(
    rule: Rule,
    traces: Sequence[Tensor],
    gradients: Sequence[Tensor],
    td_error: Tensor,
    chosen_td_error: Tensor,
    decay: Tensor,
    greedy: Tensor | None,
    goes_on: Tensor,
) -> list[tuple[Tensor, Tensor]]:
    """Δw and the new trace of all tensors of weights, by the rule.

    Args:
        rule: which Q(λ) it is.
        traces: e of each tensor, as :meth:`Rule.no_trace` has it.
        gradients: ∇Q(s, a) of each, ``[*weights, runs]``.
        td_error: δ, ``[runs]``.
        chosen_td_error: δ′, ``[runs]``.
        decay: γλ, ``[runs]``.
        greedy: 1 where the action was greedy, else 0, ``[runs]``; for ``watkins`` only.
        goes_on: 1, or 0 where the episode has ended, also by truncation, ``[runs]``.
    """
    errors = _errors(rule, td_error, chosen_td_error)
    pairs = zip(traces, gradients, strict=True)
    if rule.trace == "window":
        keeps = 1.0 if greedy is None else greedy
        return [credit_window(e, f, *errors, decay, keeps, goes_on) for e, f in pairs]
    if greedy is not None:
        decay = decay * greedy
    if rule.trace == "replacing":
        at_once = rule.variant != "peng"
        return [credit_replacing(e, f, *errors, decay, goes_on, at_once=at_once) for e, f in pairs]
    scale = step_h_scale(gradients, rule.trace)
    return [credit(e, f, *errors, decay, scale, goes_on) for e, f in pairs]


def present_trace(
    rule: Rule,
    traces: Sequence[Tensor],
    gradients: Sequence[Tensor],
    decay: Tensor,
    greedy: Tensor | None,
) -> list[Tensor]:
    """z, the trace with the present pair in it: Δw of a step whose two errors are both 1.

        z = γλe + ∇Q(s, a),  or what the rule makes of it

    Args:
        rule, traces, gradients, decay, greedy: as in :func:`credit_all`.

    Returns:
        z of each tensor of weights, ``[*weights, runs]``.
    """
    one = torch.ones_like(decay)
    return [z for z, _ in credit_all(rule, traces, gradients, one, one, decay, greedy, one)]


def largest_error(rule: Rule, td_error: Tensor, chosen_td_error: Tensor) -> Tensor:
    """The larger, by absolute value, of the errors that the rule goes by: max(|δ|, |δ′|) or |δ′|.

    Args:
        rule: which Q(λ) it is.
        td_error, chosen_td_error: δ and δ′, any shape.
    """
    past_error, present_error = _errors(rule, td_error, chosen_td_error)
    return torch.maximum(past_error.abs(), present_error.abs())
