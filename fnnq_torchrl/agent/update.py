"""The Q(λ) update, used by the learning step and :class:`EligibilityTrace`. Runs come first."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.equations.exploration import is_greedy
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import Step
from fnnq_torchrl.equations.traces import Correction, Credited

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

    def step(
        self,
        transition: TensorDictBase,
        errors: Errors,
        gradient: Weights,
        trace: Weights,
        decay: Tensor,
        *,
        error_slope: Callable[[], Sequence[Tensor]] = tuple,
        alpha: Tensor | None = None,
        of_all: Weights | None = None,
    ) -> Step:
        """Return a learning step, as the trace and the step size see it, with the runs last.

        Args:
            transition: one step of every run, ``[runs]``, with ``"next"``.
            errors: the transition's errors and values, each ``[runs, 1]``.
            gradient: ∇Q(s, a) by name, each ``[runs, *weights]``.
            trace: e before the step, by name.
            decay: γλ, ``[runs, 1]`` or one number.
            error_slope: a function that returns ∇δ′, for the step sizes that need it.
            alpha: the step size of this step, ``[runs, 1]``, for a dutch trace.
            of_all: ∇ΣQ(s, ·) by name, for a clearing trace.
        """
        done = transition["next", self._keys.done]
        credit = self.rule.credit(
            per_run(errors.td_error),
            per_run(errors.chosen_td_error),
            per_run(decay),
            self._greedy(transition),
            per_run(done).logical_not().to(errors.td_error.dtype),
            of_all=None if of_all is None else _runs_last(of_all, gradient),
            correction=self._correction(errors, trace, alpha),
        )
        traces, gradients = _runs_last(trace, gradient), _runs_last(gradient, gradient)
        return Step(self.rule.trace, traces, gradients, credit, error_slope)

    def updated(self, credited: Credited, errors: Errors, names: Iterable[str]) -> Updated:
        """Return what the trace has made of a step, by the names of the weights.

        Args:
            credited: the direction and the trace after the step, in the order of ``names``.
            errors: as in :meth:`step`.
            names: the names of the weights.
        """
        direction, after = {}, {}
        if self.rule.trace.corrects:
            after[LAST_VALUE] = errors.next_value
        for name, (one, other) in zip(names, credited, strict=True):
            direction[name], after[name] = runs_first(one), runs_first(other)
        return Updated(direction, after)

    def _correction(
        self, errors: Errors, trace: Weights, alpha: Tensor | None
    ) -> Correction | None:
        if not self.rule.trace.corrects or alpha is None:
            return None
        change = errors.chosen_value.detach() - trace[LAST_VALUE]
        return Correction(per_run(alpha), per_run(change))

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
