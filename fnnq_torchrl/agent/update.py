"""The Q(λ) update, used by the learning step and :class:`EligibilityTrace`. Runs come first."""

from collections.abc import Mapping
from typing import NamedTuple

from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.equations.exploration import is_greedy
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule

Weights = Mapping[str, Tensor]
"""Tensors ``[runs, *weights]``, by the names of a network's parameters."""


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
    """

    def __init__(self, loss: PengQLambdaLoss, rule: Rule) -> None:
        self.rule = rule
        self._keys, self._candidates = loss.tensor_keys, loss.value_network.candidates

    def start(self, weights: Weights) -> dict[str, Tensor]:
        """Return the trace before the first step.

        Args:
            weights: the weights by name, each ``[runs, *weights]``.
        """
        return {
            name: runs_first(self.rule.trace.start(runs_last(w))) for name, w in weights.items()
        }

    def update(
        self,
        transition: TensorDictBase,
        errors: Errors,
        gradient: Weights,
        trace: Weights,
        decay: Tensor,
    ) -> Updated:
        """Return the direction of a step and the trace after the step.

        Args:
            transition: one step of every run, ``[runs]``, with ``"next"``.
            errors: the transition's δ and δ′, each ``[runs, 1]``.
            gradient: ∇Q(s, a) by name, each ``[runs, *weights]``.
            trace: e before the step, by name.
            decay: γλ, ``[runs, 1]`` or one number.
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
        )
        direction, after = {}, {}
        for name, (one, other) in zip(gradient, credited, strict=True):
            direction[name], after[name] = runs_first(one), runs_first(other)
        return Updated(direction, after)

    def present_trace(
        self, transition: TensorDictBase, gradient: Weights, trace: Weights, decay: Tensor
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
        )

    def largest_error(self, errors: Errors) -> Tensor:
        """Return the largest of |δ| and |δ′| that the variant of Q(λ) uses, ``[runs]``."""
        return self.rule.largest_error(per_run(errors.td_error), per_run(errors.chosen_td_error))

    def _greedy(self, transition: TensorDictBase) -> Tensor | None:
        """Return 1 where the action was greedy, else 0, ``[runs]``; None if never needed."""
        if not self.rule.variant.cuts:
            return None
        values = transition[self._keys.action_value].movedim(-1, 0)
        return is_greedy(values, self._candidates, per_run(transition[self._keys.action]))


def _runs_last(tensors: Weights, order: Weights) -> list[Tensor]:
    return [runs_last(tensors[name]) for name in order]
