"""The change of the weights by the rule for the step size. Runs come first."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.update import Weights
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.step_size import State, Step, StepSize
from fnnq_torchrl.equations.traces import Credited


class Moved(NamedTuple):
    """The result of a step for the weights.

    Attributes:
        weights: the weights after the step, by name.
        credited: the directions and the trace after the step.
        alpha: α, ``[runs, 1]``; of a rule with a step size for each weight, their mean.
        remembered: the entry ``step_size`` of the state, by its name; empty if the rule remembers
            nothing.
    """

    weights: dict[str, Tensor]
    credited: Credited
    alpha: Tensor
    remembered: dict[str, Any]


class WeightStep:
    """The rule for the step size, as it changes the weights of a batch of runs.

    Args:
        rule: the rule.
        learns: 1 for weights that learn and 0 for those that don't, ``[*weights]``, by name.
            Weights without an entry learn.
    """

    def __init__(self, rule: StepSize, learns: Weights) -> None:
        self.rule, self._learns = rule, learns

    def start(self, run: TensorDictBase, weights: Weights) -> dict[str, Any]:
        """Return the entry ``step_size`` before the first step, by its name, if there is one."""
        kept = self.rule.start(per_run(run["alpha"]), [*map(runs_last, weights.values())])
        return {
            key: TensorDict(entry, batch_size=run.batch_size, device=run.device)
            for key, entry in _by_name(kept, weights).items()
        }

    def update(
        self,
        run: Mapping[str, Tensor],
        state: Mapping[str, Any],
        weights: Weights,
        alpha: Tensor,
        step: Step,
    ) -> Moved:
        """Return the weights after a step, w ← w + α·Δw, and what the rule remembers.

        Args:
            run: the values of the runs, with the rule's ``numbers``.
            state: the learner's state before the step.
            weights: the weights before the step, by name.
            alpha: α in this step, ``[runs, 1]``.
            step: the step, as the trace has made it.
        """
        credited, sizes, after, kept = self.rule.update(
            per_run(alpha),
            {name: per_run(run[name]) for name in self.rule.numbers},
            _in_order(state.get("step_size", {}), weights),
            step,
        )
        moved = {
            name: runs_first(runs_last(weight) + self._of_learning(name, size) * direction)
            for (name, weight), size, (direction, _) in zip(
                weights.items(), sizes, credited, strict=True
            )
        }
        return Moved(moved, credited, after.unsqueeze(-1), _by_name(kept, weights))

    def _of_learning(self, name: str, size: Tensor) -> Tensor:
        """Return the step size of the weights with this name, 0 for weights that don't learn."""
        return size * self._learns[name].unsqueeze(-1) if name in self._learns else size


def _in_order(entry: Mapping[str, Any], names: Iterable[str]) -> State:
    """Return what a rule remembers, for the equations: in the order of the weights' names."""
    return {key: [runs_last(of[name]) for name in names] for key, of in entry.items()}


def _by_name(kept: State, names: Iterable[str]) -> dict[str, dict[str, dict[str, Tensor]]]:
    """Return the entry ``step_size`` of the state, by its name; none if nothing is remembered."""
    entry = {
        key: dict(zip(names, map(runs_first, tensors), strict=True))
        for key, tensors in kept.items()
    }
    return {"step_size": entry} if entry else {}
