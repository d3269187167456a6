"""Gathers the unfinished runs of all worker threads, so that they can be saved together."""

from collections.abc import Callable, Sequence

from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.training.resume.interruptions import Interruptions

Hand = tuple[Tensor, TensorDictBase]
"""The unfinished jobs of a worker: their numbers, int64 ``[busy]``, and states, ``[busy]``."""


class HandsKeeper:
    """The :class:`fnnq_torchrl.engine.scheduler.Keeper` that saves whenever a save is due.

    When a save is due, each worker copies its unfinished runs at its next call of :meth:`visit`,
    and goes on. The last worker to do so saves all copies and the finished runs. A training that
    resumes from these copies repeats the steps that came after them, with the same results.

    Args:
        interruptions: the object that says when a save is due, and whether the work is to end.
        save: the function that saves, called with one `Hand` from each worker that has unfinished
            runs. If it raises an `OSError`, the work goes on, and the next save is due an interval
            later; but if the work was about to end, it ends with `Lost`.
    """

    def __init__(
        self, interruptions: Interruptions, save: Callable[[Sequence[Hand]], None]
    ) -> None:
        self._interruptions, self._save = interruptions, save
        self._busy: set[int] = set()
        self._hands: dict[int, Hand] | None = None  # by worker, while they are gathered

    def visit(self, worker: int, jobs: Tensor, state: TensorDictBase) -> None:
        busy = jobs >= 0
        if busy.any():
            self._busy.add(worker)
        else:
            self._busy.discard(worker)
        if self._hands is None:
            if not self._interruptions.due():
                return
            self._hands = {}
        if worker in self._busy and worker not in self._hands:
            self._hands[worker] = jobs[busy], state[busy.to(state.device)].clone()
        if self._busy <= self._hands.keys():
            hands, self._hands = [*self._hands.values()], None
            self._save_all(hands)

    def finish(self) -> None:
        """Save once more if the work is to end; call this when no worker has unfinished runs.

        Raises:
            Interrupted: if the work is to end, and is saved.
            Lost: if the work is to end, and can't be saved.
        """
        if self._interruptions.ending:
            self._save_all([])

    def _save_all(self, hands: Sequence[Hand]) -> None:
        try:
            self._save(hands)
        except OSError as error:
            self._interruptions.failed(error)
        else:
            self._interruptions.saved()
