"""The form of all rules for the step size, and the paper's rule. The runs come last."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor

from fnnq_torchrl.equations.traces import Credit, Credited, Trace

State = Mapping[str, Sequence[Tensor]]
"""What a rule remembers of each weight: for every name, tensors shaped as the weights."""

Numbers = Mapping[str, Tensor]
"""A rule's parameters by their configuration keys, each ``[runs]``."""


@dataclass(frozen=True)
class Step:
    """A learning step, as the rules for the step size see it.

    A step is α(δe + δ′∇Q(s, a)). Several rules need the trace including the present pair, z =
    γλe + ∇Q(s, a), which is the step's direction if both errors are 1. Watkins' and naive Q(λ) and
    Sarsa(λ) step along δ′z, as do the learners of the rules' sources. Peng's Q(λ) has two errors.

    Attributes:
        trace: the kind of trace.
        traces: e before the step, a tensor for each tensor of weights.
        gradients: f = ∇Q(s, a), tensors ``[*weights, runs]``; the features, if Q is linear.
        credit: the errors and factors of the step.
        error_slope: a function that returns ∇δ′ = γφ′ − φ with φ = ∇Q(s, a) and φ′ = ∇V(s′), shaped
            as the gradients; only the rules that need it call it.
    """

    trace: Trace
    traces: Sequence[Tensor]
    gradients: Sequence[Tensor]
    credit: Credit
    error_slope: Callable[[], Sequence[Tensor]]

    @property
    def error(self) -> Tensor:
        """δ′ = r + γV(s′) − Q(s, a), ``[runs]``."""
        return self.credit.present_error

    def credited(self) -> Credited:
        """Return Δw and the trace after the step, for each tensor of weights."""
        return self.trace.update(self.traces, self.gradients, self.credit)

    def present_trace(self) -> list[Tensor]:
        """Return z, the trace including the present pair, tensors ``[*weights, runs]``."""
        one = torch.ones_like(self.credit.decay)
        credit = self.credit._replace(past_error=one, present_error=one, goes_on=one)
        return [z for z, _ in self.trace.update(self.traces, self.gradients, credit)]

    def largest_error(self) -> Tensor:
        """Return the largest of the errors' absolute values, ``[runs]``."""
        return torch.maximum(self.credit.past_error.abs(), self.credit.present_error.abs())


class Stepped(NamedTuple):
    """The result of a rule for one learning step.

    Attributes:
        credited: the direction Δw and the trace after the step, for each tensor of weights.
        sizes: the step sizes, for each tensor of weights ``[runs]`` or ``[*weights, runs]``; the
            weights change by their product with Δw.
        alpha: the current α, ``[runs]``; of a rule with a step size for each weight, their mean.
        state: what the rule remembers, for the next step.
    """

    credited: Credited
    sizes: Sequence[Tensor]
    alpha: Tensor
    state: State


class StepSize:
    """The paper's step size, unchanged within a step; :func:`decayed` lowers it after successes.

    Attributes:
        numbers: the configuration keys of the rule's parameters, which differ from run to run.
    """

    numbers: ClassVar[tuple[str, ...]] = ()

    def start(self, alpha: Tensor, weights: Sequence[Tensor]) -> State:
        """Return what the rule remembers before the first step.

        Args:
            alpha: α at the start, ``[runs]``.
            weights: the weights, tensors ``[*weights, runs]``.
        """
        return {}

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        """Return the step sizes of a step, and what is kept for the next step.

        Args:
            alpha: the α kept from the last step, ``[runs]``.
            numbers: the rule's parameters by key, each ``[runs]``.
            state: what the rule remembers.
            step: the learning step.
        """
        return Stepped(step.credited(), [alpha] * len(step.gradients), alpha, state)


def decayed(alpha: Tensor, decay: Tensor, success: Tensor) -> Tensor:
    """Return decay·α where ``success`` (bool) is true, and α elsewhere; all have one shape.

    The paper: «we decreased α whenever the agent got reward», without a figure. The paper's robot
    gets a reward when it catches the ball, which is a success.
    """
    return torch.where(success, decay * alpha, alpha)


def total(tensors: Sequence[Tensor]) -> Tensor:
    """Return the sum over all weights: from tensors ``[*weights, runs]`` to ``[runs]``."""
    return reduce(torch.add, (x.flatten(0, -2).sum(0) for x in tensors))


def mean(tensors: Sequence[Tensor]) -> Tensor:
    """Return the mean over all weights: from tensors ``[*weights, runs]`` to ``[runs]``."""
    return total(tensors) / sum(x[..., 0].numel() for x in tensors)


def filled(numbers: Tensor, weights: Sequence[Tensor]) -> list[Tensor]:
    """Return tensors shaped as the weights that hold one number for each run, ``[runs]``."""
    return [torch.zeros_like(w) + numbers for w in weights]
