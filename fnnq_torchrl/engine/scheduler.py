"""Run many jobs on few lanes: when a lane's job is done, the lane gets the next job."""

from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import suppress
from threading import Lock
from typing import Protocol

import torch
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.engine.lanes import lanes_for, repeat_last, share
from fnnq_torchrl.engine.limits import NO_THREADS
from fnnq_torchrl.engine.loops import Loop, Running


class Task(Protocol):
    """Jobs that repeat the same step, each until it is done. They are numbered from 0.

    Attributes:
        loop: the loop around their step.
        steps: the number of steps from one :meth:`collect` to the next.
    """

    loop: Loop
    steps: int

    def begin(self, jobs: Tensor) -> tuple[TensorDictBase, TensorDictBase]:
        """Return ``stays`` and the first ``state`` of jobs (:data:`.loops.Step`).

        Args:
            jobs: the jobs' numbers, int64 ``[lanes]``.

        Returns:
            Two TensorDicts of batch size ``[lanes]``.
        """

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        """Keep the jobs' new results; only one worker at a time calls this.

        Args:
            jobs: each lane's job number, −1 for an idle lane, int64 ``[lanes]``.
            state: the lanes' state, batch size ``[lanes]``.

        Returns:
            True for each lane whose job is done, bool ``[lanes]``.
        """


class Keeper(Protocol):
    """Saves the workers' unfinished jobs."""

    def visit(self, worker: int, jobs: Tensor, state: TensorDictBase) -> None:
        """Look at a worker's lanes; each worker calls this after :meth:`Task.collect`.

        Args:
            worker: the worker's number.
            jobs: each lane's job number, −1 for an idle lane, int64 ``[lanes]``.
            state: the lanes' state, batch size ``[lanes]``. Later steps may overwrite it in place.

        Raises:
            Exception: of any kind, to stop all workers.
        """


class _Queue:
    """Hands out job numbers, each once, to whichever thread asks."""

    def __init__(self, jobs: Tensor) -> None:
        self.closed = False
        self._jobs, self._next = jobs, 0
        self._lock = Lock()

    def take(self, count: int) -> Tensor:
        """Return the next ``count`` job numbers, or fewer if fewer are left."""
        with self._lock:
            first = self._next
            self._next = min(len(self._jobs), first + count)
            return self._jobs[first : self._next]


def work_through(
    task: Task, jobs: Tensor, lanes: int, workers: int, keeper: Keeper | None = None
) -> None:
    """Run a task's jobs to their end.

    Jobs are independent, so their results depend neither on the lanes nor on the workers.

    Args:
        task: the task.
        jobs: the numbers of the jobs to run, int64 ``[jobs]``.
        lanes: the number of jobs that a worker runs side by side.
        workers: the number of threads, or fewer if the system doesn't allow so many; more than one
            helps only if the task's loop releases the GIL.
        keeper: saves the unfinished jobs; called after each :meth:`Task.collect`.

    Raises:
        ConfigError: if the system doesn't allow a single thread.
    """
    queue, turn = _Queue(jobs), Lock()
    # A loop for a fixed number of lanes takes as long for a few jobs as for all its lanes.
    first = min(lanes, share(len(jobs), workers)) if task.loop.any_lanes else lanes
    # Even a single worker has its own thread: the main thread must stay free to handle signals.
    with ThreadPoolExecutor(workers) as pool:
        shifts = []
        with suppress(RuntimeError):  # raised if the system allows no more threads
            for worker in range(workers):
                shifts.append(pool.submit(_work, task, queue, lanes, first, turn, worker, keeper))
        if not shifts:
            raise ConfigError(f"no thread can be started here: {NO_THREADS}")
        try:
            wait(shifts, return_when=FIRST_EXCEPTION)
        finally:
            queue.closed = True  # after a failure or Ctrl-C, all workers stop
    for shift in shifts:
        shift.result()


@torch.no_grad()
def _work(
    task: Task,
    queue: _Queue,
    lanes: int,
    first: int,
    turn: Lock,
    worker: int,
    keeper: Keeper | None,
) -> None:
    """Take ``first`` jobs, then others into each free lane, until none is left."""
    fresh = queue.take(first)
    if not len(fresh):
        return
    running = task.loop(*task.begin(repeat_last(fresh, lanes)))
    jobs = torch.full((lanes,), -1)
    jobs[: len(fresh)] = fresh
    _rest(running, jobs)
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
    """Drop idle lanes once no jobs are left to start, if a smaller batch holds the busy ones."""
    busy = (jobs >= 0).nonzero().squeeze(-1)
    if not len(busy):
        return busy, running
    lanes = lanes_for(len(busy), workers=1, most=len(jobs))
    if lanes == len(jobs) or not loop.any_lanes:
        return jobs, running
    kept = repeat_last(busy, lanes)
    jobs = jobs[kept]
    jobs[len(busy) :] = -1
    running = loop(running.stays[kept], running.state[kept])
    _rest(running, jobs)
    return jobs, running


def _rest(running: Running, jobs: Tensor) -> None:
    """Mark the lanes without a job as finished: a native loop skips vectors of such lanes."""
    if "over" in running.state:
        running.state["over"][jobs < 0] = True
