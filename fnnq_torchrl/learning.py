"""Runs that learn, as jobs on lanes."""

from collections.abc import Callable

import torch
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.loops import Loop
from fnnq_torchrl.program import Program
from fnnq_torchrl.snapshots import SnapshotBook


class Learning:
    """The :class:`fnnq_torchrl.work.Task` of all runs of a job: each has its situations to learn.

    Args:
        program: one learning step, for as many runs as there are lanes.
        loop: of that step.
        run: what each run is, ``[runs]``.
        situations: after which the runs are done.
        book: where the snapshots go.
        on_progress: is told how many situations, of all runs together, are done.
    """

    def __init__(
        self,
        program: Program,
        loop: Loop,
        run: TensorDictBase,
        situations: int,
        book: SnapshotBook,
        on_progress: Callable[[int], None],
    ) -> None:
        self.run = run
        self.loop = loop
        # In so few steps no run can come to a second snapshot.
        self.steps = program.env.fewest_steps * program.evaluate_every
        self._program, self._book = program, book
        self._situations = situations
        self._done = torch.zeros(len(run), dtype=torch.int64)
        self._on_progress = on_progress

    def begin(self, jobs: Tensor) -> tuple[TensorDictBase, TensorDictBase]:
        run = self.run[jobs.to(self.run.device)]
        return run, self._program.begin(run)

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        self._book.collect(jobs, state)
        situations = state["situations"].squeeze(-1).cpu().clamp(max=self._situations)
        busy = jobs >= 0
        self._done[jobs[busy]] = situations[busy]
        self._on_progress(int(self._done.sum()))
        return state["over"].squeeze(-1).cpu()
