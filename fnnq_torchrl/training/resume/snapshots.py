"""The weights and other numbers of all runs at each evaluation."""

from collections.abc import Mapping

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.config.schema import ConfigError


class SnapshotBook:
    """The snapshots of all runs: their weights and steps when each evaluation was due.

    Attributes:
        pages: the snapshots, a page for each evaluation, batch size ``[evaluations, runs]``:
            ``weights`` by name, ``steps``, int64, and the numbers of ``told`` by name. The first
            page is that before learning.
        collected: the index of the last page that each run has reached, int64 ``[runs]``.
        every: the number of situations from one evaluation to the next.

    Args:
        weights: the weights before learning, by name, each ``[runs, *weights]``.
        told: the other numbers that the learner's snapshots have, such as ``alpha``: before
            learning, by name, each ``[runs, 1]``.
        every: the number of situations from one evaluation to the next.
        evaluations: the number of evaluations, including the one before learning.
    """

    def __init__(
        self,
        weights: Mapping[str, Tensor],
        told: Mapping[str, Tensor],
        every: int,
        evaluations: int,
    ) -> None:
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
        # The same tensors, by their keys in a snapshot of the learner's.
        self._page_of: dict[str | tuple[str, str], Tensor] = {"steps": self.pages["steps"]}
        for name, weight in weights.items():
            self._page_of["weights", name] = self.pages["weights", name]
            self.pages["weights", name][0] = weight
        for name, number in told.items():
            self.pages[name] = number.squeeze(-1).expand(shape).clone()
            self._page_of["told", name] = self.pages[name]
        self.collected = torch.zeros(runs, dtype=torch.int64)

    def close(self, runs: Tensor, steps: Tensor) -> None:
        """Copy the last page of each run that has stopped onto the pages after it.

        Args:
            runs: the numbers of the stopped runs, int64 ``[closed]``.
            steps: the number of steps that each has taken, int64 ``[closed]``.
        """
        for run, taken in zip(runs.tolist(), steps.tolist(), strict=True):
            last = int(self.collected[run])
            for page in self._page_of.values():
                page[last + 1 :, run] = page[last, run]
            self.pages["steps"][last + 1 :, run] = taken

    def collect(self, runs: Tensor, state: TensorDictBase) -> None:
        """Copy the snapshots that are new since the last call onto their pages.

        Snapshots after a run's last evaluation are ignored.

        Args:
            runs: the number of the run on each lane (row) of the batch, −1 for an empty lane, int64
                ``[lanes]``.
            state: the learner's state, ``[lanes]``.

        Raises:
            ConfigError: if a run has taken two snapshots since the last call; the first is lost.
        """
        due = (state["situations"].squeeze(-1).cpu() // self.every).clamp(max=self._last)
        new = torch.where(runs >= 0, due - self.collected[runs], 0)
        if (new > 1).any():
            raise ConfigError(
                "a run was due for two evaluations at once: the world's fewest_steps must not be "
                "larger than the number of steps of its shortest episode"
            )
        lanes = (new > 0).nonzero().squeeze(-1)
        if len(lanes):
            runs, due, snapshot = runs[lanes], due[lanes], state["snapshot"]
            for key, page in self._page_of.items():
                page[due, runs] = snapshot[key][lanes].view(-1, *page.shape[2:])
            self.collected[runs] = due
