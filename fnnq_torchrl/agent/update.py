"""The Q(λ) update, used by the learning step and :class:`EligibilityTrace`. Runs come first."""

from collections.abc import Mapping
from typing import NamedTuple

from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.equations.exploration import is_greedy
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.traces import Correction

Weights = Mapping[str, Tensor]
"""Tensors ``[runs, *weights]``, by the names of a network's parameters."""


LAST_VALUE = "last_value"
"""The name of the trace's entry for Q_old, the present pair's value before the last update."""


class Updated(NamedTuple):
    """The direction of a step and the trace after the step.

    Attributes:
        direction: Δw, which the caller multiplies by the step size α; by name, each
            ``[runs, *weights]``.
        trace: e after the step, by name.
    """

    direction: dict[str, Tensor]
    trace: dict[str, Tensor]


class Update:
    """The update of a network's weights and trace by a step (paper, Table 1).

    Args:
        loss: the loss module, which defines the keys of TensorDicts and the candidates.
        rule: the variant of Q(λ) and its trace.

    Raises:
        ValueError: if the loss bootstraps from another value than the variant.
    """

    def __init__(self, loss: PengQLambdaLoss, rule: Rule) -> None:
        if loss.bootstrap != rule.variant.bootstrap:
            needed = rule.variant.bootstrap
            raise ValueError(f"bootstrap={loss.bootstrap!r}: this variant needs {needed!r}")
        self.rule = rule
        self._keys, self._candidates = loss.tensor_keys, loss.value_network.candidates

    def start(self, weights: Weights) -> dict[str, Tensor]:
        """Return the trace before the first step.

        Args:
            weights: the weights by name, each ``[runs, *weights]``.
        """
        trace = {
            name: runs_first(self.rule.trace.start(runs_last(w))) for name, w in weights.items()
        }
        if self.rule.trace.corrects:
            first = next(iter(weights.values()))
            trace[LAST_VALUE] = first.new_zeros(len(first), 1)
        return trace

    def update(
        self,
        transition: TensorDictBase,
        errors: Errors,
        gradient: Weights,
        trace: Weights,
        decay: Tensor,
        *,
        alpha: Tensor | None = None,
        of_all: Weights | None = None,
    ) -> Updated:
        """Return the direction of a step and the trace after the step.

        Args:
            transition: one step of every run, ``[runs]``, with ``"next"``.
            errors: the transition's errors and values, each ``[runs, 1]``.
            gradient: ∇Q(s, a) by name, each ``[runs, *weights]``.
            trace: e before the step, by name.
            decay: γλ, ``[runs, 1]`` or one number.
            alpha: the step size of this step, ``[runs, 1]``, for a dutch trace.
            of_all: ∇ΣQ(s, ·) by name, for a clearing trace.
        """
        done = transition["next", self._keys.done]
        credited = self.rule.update(
            _runs_last(trace, gradient),
            _runs_last(gradient, gradient),
            per_run(errors.td_error),
            per_run(errors.chosen_td_error),
            per_run(decay),
            self._greedy(transition),
            per_run(done).logical_not().to(errors.td_error.dtype),
            of_all=None if of_all is None else _runs_last(of_all, gradient),
            correction=self._correction(errors, trace, alpha),
        )
        direction, after = {}, {}
        if self.rule.trace.corrects:
            after[LAST_VALUE] = errors.next_value
        for name, (one, other) in zip(gradient, credited, strict=True):
            direction[name], after[name] = runs_first(one), runs_first(other)
        return Updated(direction, after)

    def _correction(
        self, errors: Errors, trace: Weights, alpha: Tensor | None
    ) -> Correction | None:
        if not self.rule.trace.corrects or alpha is None:
            return None
        change = errors.chosen_value.detach() - trace[LAST_VALUE]
        return Correction(per_run(alpha), per_run(change))

    def present_trace(
        self,
        transition: TensorDictBase,
        gradient: Weights,
        trace: Weights,
        decay: Tensor,
        *,
        of_all: Weights | None = None,
    ) -> list[Tensor]:
        """Return z, the trace including the present pair; arguments as in :meth:`update`.

        Returns:
            z for each tensor of weights, with the runs last, ``[*weights, runs]``.
        """
        return self.rule.present_trace(
            _runs_last(trace, gradient),
            _runs_last(gradient, gradient),
            per_run(decay),
            self._greedy(transition),
            of_all=None if of_all is None else _runs_last(of_all, gradient),
        )

    def largest_error(self, errors: Errors) -> Tensor:
        """Return the largest of |δ| and |δ′| that the variant of Q(λ) uses, ``[runs]``."""
        return self.rule.largest_error(per_run(errors.td_error), per_run(errors.chosen_td_error))

    def _greedy(self, transition: TensorDictBase) -> Tensor | None:
        """Return 1 where the action was greedy, else 0, ``[runs]``; None if never needed."""
        if not self.rule.variant.cuts:
            return None
        values = transition[self._keys.action_value].movedim(-1, 0)
        action = transition[self._keys.action].view(values.shape[1:])
        greedy = is_greedy(values, self._candidates, action)
        return greedy.view(len(greedy), -1).amin(-1)  # if each rule chooses, all must be greedy


def _runs_last(tensors: Weights, order: Weights) -> list[Tensor]:
    return [runs_last(tensors[name]) for name in order]
