"""The record of how close a batch of runs comes to a world's best mean reward. Runs come first."""

from collections.abc import Mapping
from typing import Any, Self

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.records import Record
from fnnq_torchrl.agent.update import Weights
from fnnq_torchrl.equations.layout import per_run
from fnnq_torchrl.equations.reward_means import (
    MEAN_STEPS,
    Means,
    Solution,
    no_solution,
    running_means,
    watched,
)

TOLD = ("solved", "lowest", "later", "above")
"""The entries of the record that an evaluation tells."""


class Watch(Record):
    """The running means of the reward, and the record of a stage, as a TensorDict ``[runs]``.

    The entries, each ``[runs, 1]``, are those of :class:`.Means` and :class:`.Solution`.

    Args:
        env: a world without end, which states the best mean reward.
    """

    name = "watch"

    def __init__(self, env: PureEnv) -> None:
        self._env = env

    @classmethod
    def of(cls, env: PureEnv) -> Self | None:
        """Return the watch of a world, or None if the world states no best mean reward."""
        best = env.best_mean(torch.ones(*env.batch_size, 1, dtype=torch.int64, device=env.device))
        return None if best is None else cls(env)

    def start(self, run: TensorDictBase, weights: Weights) -> TensorDict:
        zero = torch.zeros_like(per_run(run["alpha"]))
        return self._packed(Means(zero, zero.clone()), no_solution(zero), run)

    def update(self, state: Mapping[str, Any], slope: Weights, after: TensorDictBase) -> TensorDict:
        before = state["watch"]
        means = Means(*(per_run(before[key]) for key in Means._fields))
        means = running_means(means, per_run(after["reward"]), MEAN_STEPS, MEAN_STEPS)
        solution = Solution(*(per_run(before[key]) for key in Solution._fields))
        best = self._env.best_mean(after["step"])
        assert best is not None
        return self._packed(means, watched(solution, means.long / per_run(best)), before)

    def renewed(self, record: TensorDictBase, due: Tensor) -> TensorDict:
        """Return the record with a new stage begun where ``due``; the means go on."""
        new = no_solution(per_run(record["long"]))
        fresh = {key: value.unsqueeze(-1) for key, value in new._asdict().items()}
        return TensorDict(
            {
                key: torch.where(due, fresh[key], value) if key in fresh else value
                for key, value in record.items()
            },
            record.batch_size,
            device=record.device,
        )

    def told(self, record: TensorDictBase) -> dict[str, Tensor]:
        return {key: record[key] for key in TOLD}

    def _packed(self, means: Means, solution: Solution, like: TensorDictBase) -> TensorDict:
        entries = {**means._asdict(), **solution._asdict()}
        return TensorDict(
            {key: value.unsqueeze(-1) for key, value in entries.items()},
            like.batch_size,
            device=like.device,
        )
