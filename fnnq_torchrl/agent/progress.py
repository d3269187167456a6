"""The counts of a batch of learning runs, and the snapshots for their evaluations."""

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.records import Record
from fnnq_torchrl.agent.update import Weights
from fnnq_torchrl.equations.layout import over_batch, runs_first, runs_last


def ended(env: PureEnv, situations: Tensor, after: TensorDictBase) -> Tensor:
    """Return whether a situation has ended with a step, bool ``[runs, 1]``.

    Args:
        env: the world.
        situations: the number of situations before the step, int64 ``[runs, 1]``.
        after: the entry ``"next"`` of the step.
    """
    of_situation = env.world.steps_of_situation
    if of_situation is None:
        return after["done"]
    return after["step"] >= (situations + 1) * of_situation


def copied(weight: Tensor) -> Tensor:
    """Return a copy of the weights with the runs as the last dimension in memory."""
    return runs_first(runs_last(weight).contiguous().clone())


class Progress:
    """The counts of the runs, their records, and the snapshots for their evaluations.

    The entries of the learner's state:

    * ``situations`` and ``steps``, the numbers learned from so far, int64 ``[runs, 1]``;
    * ``diverged``, whether |Q| has become too large, after which the run counts no more steps;
    * ``over``, whether the run has ended, by its number of situations or because it diverged;
    * ``snapshot``, the weights and counts at the time when an evaluation was last due, with the
      numbers that the evaluation tells as ``told``, among them ``alpha``;
    * the records, by their names.

    Args:
        env: the world.
        records: the records to keep; what they sum up from one evaluation to the next begins again
            with a snapshot.
        evaluate_every: the number of situations from one evaluation to the next.
        largest_value: the |Q| above which a run has diverged.
    """

    def __init__(
        self, env: PureEnv, records: Sequence[Record], evaluate_every: int, largest_value: float
    ) -> None:
        self._env, self._records = env, records
        self._evaluate_every, self._largest_value = evaluate_every, largest_value

    def start(self, run: TensorDictBase, weights: Weights, told: Weights) -> dict[str, Any]:
        """Return the entries before the first step.

        Args:
            run: the values of the runs.
            weights: the network's weights and statistics, by name.
            told: the learner's numbers that an evaluation tells, by name.
        """
        zero = torch.zeros_like(run["seed"])  # cloned, because entries must not share memory
        records = {each.name: each.start(run, weights) for each in self._records}
        told = {name: number.clone() for name, number in self._told(told, records).items()}
        batch = {"batch_size": run.batch_size, "device": run.device}
        return {
            "situations": zero.clone(),
            "steps": zero.clone(),
            "diverged": torch.zeros_like(zero, dtype=torch.bool),
            "over": torch.zeros_like(zero, dtype=torch.bool),
            "snapshot": TensorDict(
                {
                    "weights": TensorDict({k: copied(w) for k, w in weights.items()}, **batch),
                    "situations": zero.clone(),
                    "steps": zero.clone(),
                    "told": TensorDict(told, **batch),
                },
                **batch,
            ),
            **records,
        }

    def update(
        self,
        run: Mapping[str, Tensor],
        state: Mapping[str, Any],
        transition: TensorDictBase,
        slope: Weights,
        weights: Weights,
        told: Weights,
    ) -> dict[str, Any]:
        """Return the entries after a step; the snapshot is new where an evaluation is due.

        Args:
            run, state: the runs, and the learner's state before the step.
            transition: the step.
            slope: ∇Q(s, a), by name.
            weights, told: as in :meth:`start`, after the step.
        """
        after = transition["next"]
        within = self._within(transition["action_value"])
        diverged = state["diverged"] | ~(within | state["over"])
        goes_on = ~diverged
        new = ended(self._env, state["situations"], after)
        situations = state["situations"] + (new & goes_on)
        steps = state["steps"] + goes_on
        snapshot = state["snapshot"]
        due = situations == snapshot["situations"] + self._evaluate_every
        records = {each.name: each.update(state, slope, after) for each in self._records}
        new_snapshot = {
            "weights": weights,
            "situations": situations,
            "steps": steps,
            "told": self._told(told, records),
        }
        return {
            "situations": situations,
            "steps": steps,
            "diverged": diverged,
            "over": (situations >= run["situations"]) | diverged,
            "snapshot": _replaced(due, new_snapshot, snapshot),
            **{each.name: each.renewed(records[each.name], due) for each in self._records},
        }

    def _told(self, told: Weights, records: Mapping[str, Any]) -> Weights:
        """Return the numbers that a snapshot has besides the weights and counts, ``[runs, 1]``."""
        of_records = {
            name: number
            for each in self._records
            for name, number in each.told(records[each.name]).items()
        }
        return {**told, **of_records}

    def _within(self, action_value: Tensor) -> Tensor:
        """Return where all |Q| are at most the largest, false for NaN, ``[runs, 1]``."""
        return action_value.abs().flatten(1).amax(-1, keepdim=True) <= self._largest_value


def _replaced(where: Tensor, new: Mapping[str, Any], old: Mapping[str, Any]) -> dict[str, Any]:
    """Return new entries for the runs where ``where`` is true and old ones for the others.

    Args:
        where: bool ``[runs, 1]``.
        new, old: tensors ``[runs, …]`` by name, some of them by names within a name.
    """
    return {
        key: torch.where(over_batch(where, like=entry), entry, old[key])
        if isinstance(entry, Tensor)
        else _replaced(where, entry, old[key])
        for key, entry in new.items()
    }
