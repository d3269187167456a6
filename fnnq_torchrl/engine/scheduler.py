"""Many jobs on few lanes: where one is done, the next begins."""

from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from threading import Lock
from typing import Protocol

import torch
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.engine.lanes import lanes_for, repeat_last
from fnnq_torchrl.engine.loops import Loop, Running


class Task(Protocol):
    """Jobs of one kind, numbered from 0, which differ in how many steps they take.

    Attributes:
        loop: of the step that they take.
        steps: how many of them from one :meth:`collect` to the next.
    """

    loop: Loop
    steps: int

    def begin(self, jobs: Tensor) -> tuple[TensorDictBase, TensorDictBase]:
        """What stays, and the state, of jobs that are to begin; each of batch size ``[lanes]``.

        Args:
            jobs: their numbers, int64 ``[lanes]``.
        """

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        """Keep what is new; by one worker at a time.

        Args:
            jobs: the number of each lane's job, −1 where there is none, int64 ``[lanes]``.
            state: theirs.

        Returns:
            Which lanes are done with their job, bool ``[lanes]``.
        """


class Keeper(Protocol):
    """Saves the unfinished work of all workers."""

    def visit(self, worker: int, jobs: Tensor, state: TensorDictBase) -> None:
        """Called after every :meth:`Task.collect`, by one worker at a time.

        Args:
            worker: which one it is.
            jobs: the number of each lane's job, −1 where it is done, int64 ``[lanes]``.
            state: theirs, ``[lanes]``, which the next steps may change where it is.

        Raises:
            Exception: of any kind, to end the work.
        """


class _Queue:
    """Hands out job numbers, each once, to whichever thread asks."""

    def __init__(self, jobs: Tensor) -> None:
        self.closed = False
        self._jobs, self._next = jobs, 0
        self._lock = Lock()

    def take(self, count: int) -> Tensor:
        """The next numbers, as many as asked for or as there are left."""
        with self._lock:
            first = self._next
            self._next = min(len(self._jobs), first + count)
            return self._jobs[first : self._next]


def work_through(
    task: Task, jobs: Tensor, lanes: int, workers: int, keeper: Keeper | None = None
) -> None:
    """Do some jobs of a task.

    Jobs know nothing of each other, so what becomes of them depends neither on the lanes nor on
    the workers.

    Args:
        task: what to do.
        jobs: the numbers of those that are to be done, int64.
        lanes: how many a worker does side by side.
        workers: threads, which pays if the task's loop leaves the interpreter to others.
        keeper: looks at what each worker has in hand from time to time.
    """
    queue, turn = _Queue(jobs), Lock()
    # However few there are, they leave the main thread alone: that one has signals to answer.
    with ThreadPoolExecutor(workers) as pool:
        shifts = [
            pool.submit(_work, task, queue, lanes, turn, worker, keeper)
            for worker in range(workers)
        ]
        try:
            wait(shifts, return_when=FIRST_EXCEPTION)
        finally:
            queue.closed = True  # after a failure or Ctrl-C, the others need not go on
    for shift in shifts:
        shift.result()


@torch.no_grad()
def _work(
    task: Task, queue: _Queue, lanes: int, turn: Lock, worker: int, keeper: Keeper | None
) -> None:
    fresh = queue.take(lanes)
    if not len(fresh):
        return
    running = task.loop(*task.begin(repeat_last(fresh, lanes)))
    jobs = torch.full((lanes,), -1)
    jobs[: len(fresh)] = fresh
    while len(jobs) and not queue.closed:
        running.advance(task.steps)
        with turn:
            jobs[task.collect(jobs, running.state)] = -1
            if keeper is not None:
                keeper.visit(worker, jobs, running.state)
        idle = (jobs < 0).nonzero().squeeze(-1)
        fresh = queue.take(len(idle))
        if len(fresh):
            idle = idle[: len(fresh)]
            jobs[idle] = fresh
            begun = task.begin(repeat_last(fresh, lanes))
            for old, new in zip((running.stays, running.state), begun, strict=True):
                old[idle] = new[: len(fresh)]
        elif len(idle):
            jobs, running = _without_idle(task.loop, jobs, running)


def _without_idle(loop: Loop, jobs: Tensor, running: Running) -> tuple[Tensor, Running]:
    """The same with fewer lanes, if few enough are busy: no job is to begin any more."""
    busy = (jobs >= 0).nonzero().squeeze(-1)
    if not len(busy):
        return busy, running
    lanes = lanes_for(len(busy), workers=1, most=len(jobs))
    if lanes == len(jobs) or not loop.any_lanes:
        return jobs, running
    kept = repeat_last(busy, lanes)
    jobs = jobs[kept]
    jobs[len(busy) :] = -1
    return jobs, loop(running.stays[kept], running.state[kept])
