"""The weights of all runs at all of their evaluations."""

import torch
from tensordict import TensorDict, TensorDictBase

from fnnq_torchrl.layout import runs_last


class SnapshotBook:
    """Collects a program's snapshots: weights and steps of every run when each evaluation was due.

    Attributes:
        pages: batch size ``[evaluations]``: ``weights`` by name, ``[evaluations, *weights, runs]``,
            and ``steps``, int64 ``[evaluations, runs]``.

    Args:
        state: the program's state before its first step, which is the first page.
        every: situations from one evaluation to the next.
        evaluations: how many there are, the one before learning included.
    """

    def __init__(self, state: TensorDictBase, every: int, evaluations: int) -> None:
        self._every = every
        self._last = evaluations - 1
        first = self._page(state)
        self.pages = first.apply(
            lambda value: value.new_zeros(evaluations, *value.shape), batch_size=[evaluations]
        )
        self.pages[0] = first
        self._collected = torch.zeros_like(state["situations"].squeeze(-1))

    def collect(self, state: TensorDictBase) -> None:
        """Put the snapshots that are new since the last call on their pages.

        No run may have had more than one in between. What runs do after their last evaluation is
        nobody's business.
        """
        due = (state["situations"].squeeze(-1) // self._every).clamp(max=self._last)
        runs = (due > self._collected).nonzero().squeeze(-1)
        if len(runs):
            page = self._page(state)
            for key in page.keys(include_nested=True, leaves_only=True):
                # Indices on the first and the last dimension bring [new, *weights].
                self.pages[key][due[runs], ..., runs] = page[key][..., runs].movedim(-1, 0)
            self._collected = due

    @staticmethod
    def _page(state: TensorDictBase) -> TensorDict:
        snapshot = state["snapshot"]
        weights = {name: runs_last(weight) for name, weight in snapshot["weights"].items()}
        return TensorDict({"weights": TensorDict(weights), "steps": snapshot["steps"].squeeze(-1)})
