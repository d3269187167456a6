"""The weights of all runs at all of their evaluations."""

from collections.abc import Mapping

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.config.schema import ConfigError


class SnapshotBook:
    """Collects a learner's snapshots: weights and steps of every run when each evaluation was due.

    Attributes:
        pages: batch size ``[evaluations, runs]``: ``weights`` by name, and ``steps``, int64. The
            first page has the weights before learning.
        collected: the last page that each run has, int64 ``[runs]``.
        every: situations from one page to the next.

    Args:
        weights: of the runs before learning, by name, each ``[runs, *weights]``.
        every: situations from one evaluation to the next.
        evaluations: how many there are, the one before learning included.
    """

    def __init__(self, weights: Mapping[str, Tensor], every: int, evaluations: int):
        self.every = every
        self._last = evaluations - 1
        first = next(iter(weights.values()))
        runs, device = len(first), first.device
        shape = (evaluations, runs)
        self.pages = TensorDict(
            {
                "weights": TensorDict(
                    {name: w.new_zeros(evaluations, *w.shape) for name, w in weights.items()},
                    shape,
                ),
                "steps": torch.zeros(shape, dtype=torch.int64, device=device),
            },
            shape,
        )
        for name, weight in weights.items():
            self.pages["weights", name][0] = weight
        self.collected = torch.zeros(runs, dtype=torch.int64)

    def close(self, runs: Tensor, steps: Tensor) -> None:
        """Have the last page of runs that go no further stand for all that were to come.

        Args:
            runs: their numbers, int64 ``[closed]``.
            steps: that they have taken, int64 ``[closed]``.
        """
        for run, taken in zip(runs.tolist(), steps.tolist(), strict=True):
            last = int(self.collected[run])
            for weights in self.pages["weights"].values():
                weights[last + 1 :, run] = weights[last, run]
            self.pages["steps"][last + 1 :, run] = taken

    def collect(self, runs: Tensor, state: TensorDictBase) -> None:
        """Put the snapshots that are new since the last call on their pages.

        Snapshots that a run takes after its last evaluation are left out.

        Args:
            runs: the number of each lane's run, −1 where there is none, int64 ``[lanes]``.
            state: the learner's, ``[lanes]``.

        Raises:
            ConfigError: a run has had more than one since then, and the earlier one is lost.
        """
        due = (state["situations"].squeeze(-1).cpu() // self.every).clamp(max=self._last)
        busy = runs >= 0
        if (busy & (due > self.collected[runs] + 1)).any():
            raise ConfigError(
                "a run had two evaluations between two looks at it: fewest_steps of the world is "
                "larger than the steps of its shortest episode"
            )
        lanes = (busy & (due > self.collected[runs])).nonzero().squeeze(-1)
        if len(lanes):
            runs, due = runs[lanes], due[lanes]
            snapshot = state["snapshot"]
            for name, weight in snapshot["weights"].items():
                self.pages["weights", name][due, runs] = weight[lanes]
            self.pages["steps"][due, runs] = snapshot["steps"][lanes].squeeze(-1)
            self.collected[runs] = due
