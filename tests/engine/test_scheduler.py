"""Many jobs on few lanes; the result of each job is known in advance."""

from collections.abc import Sequence
from threading import Barrier, Event, Thread, get_ident

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import EagerLoop, Step
from fnnq_torchrl.engine.scheduler import work_through

lengths = st.lists(st.integers(1, 9), max_size=40)
some_lanes = st.integers(1, 12)
some_workers = st.integers(1, 4)


class AnyLanes(EagerLoop):
    """A loop that accepts any number of lanes, as its step does."""

    any_lanes = True

    def __init__(self, step: Step) -> None:
        empty = TensorDict({}, [0])
        super().__init__(lambda lanes: step, empty, empty)


class Collatz:
    """Jobs with known results: job j starts at x = 27 + j and takes ``lengths[j]`` steps.

    A step is x ← x/2 for an even x, and x ← 3x + 1 + j otherwise.
    """

    def __init__(self, lengths: Sequence[int]) -> None:
        self.lengths = torch.tensor(lengths, dtype=torch.int64)
        self.loop, self.steps = AnyLanes(self.advance), 1
        self.begun: list[int] = []
        self.results: dict[int, int] = {}
        self.seen: list[Tensor] = []

    def begin(self, jobs: Tensor) -> tuple[TensorDict, TensorDict]:
        self.begun += jobs.tolist()
        job = jobs.unsqueeze(-1)
        stays = TensorDict({"job": job.clone()}, jobs.shape)
        state = {"x": 27 + job, "left": self.lengths[job], "nested": {"job": job.clone()}}
        return stays, TensorDict(state, jobs.shape)

    def advance(self, stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        job, x = stays["job"], state["x"]
        after = torch.where(x % 2 == 0, x // 2, 3 * x + 1 + job)
        nested = state["nested"].clone()
        return TensorDict(
            {"x": after, "left": state["left"] - 1, "nested": nested}, state.batch_size
        )

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        self.seen.append(jobs.clone())
        left = state["left"].squeeze(-1)
        for lane, job in enumerate(jobs.tolist()):
            if job >= 0:
                assert state["nested", "job"][lane] == job  # all entries are of one job
                if left[lane] == 0:
                    assert job not in self.results
                    self.results[job] = int(state["x"][lane])
        return left <= 0


def one_after_the_other(lengths: Sequence[int]) -> dict[int, int]:
    results = {}
    for job, length in enumerate(lengths):
        x = 27 + job
        for _ in range(length):
            x = x // 2 if x % 2 == 0 else 3 * x + 1 + job
        results[job] = x
    return results


@given(lengths, some_lanes, some_workers)
def test_every_job_is_done_once_whatever_the_lanes_and_workers(
    lengths: list[int], lanes: int, workers: int
) -> None:
    task = Collatz(lengths)
    work_through(task, torch.arange(len(lengths)), lanes, workers)
    assert task.results == one_after_the_other(lengths)


@given(lengths, some_lanes, some_workers)
def test_no_job_is_on_two_lanes_and_lanes_without_one_say_so(
    lengths: list[int], lanes: int, workers: int
) -> None:
    task = Collatz(lengths)
    work_through(task, torch.arange(len(lengths)), lanes, workers)
    advances = torch.zeros(len(lengths), dtype=torch.int64)
    for jobs in task.seen:
        assert jobs.shape == (lanes,)
        busy = jobs[jobs >= 0]
        assert (jobs[jobs < 0] == -1).all()
        assert len(busy.unique()) == len(busy)
        advances[busy] += 1
    assert advances.tolist() == lengths  # each job has exactly its own number of steps


@given(lengths.filter(len), some_lanes)
def test_no_lane_is_idle_while_a_job_waits(lengths: list[int], lanes: int) -> None:
    task = Collatz(lengths)
    work_through(task, torch.arange(len(lengths)), lanes, workers=1)
    waiting = len(lengths)
    known: set[int] = set()
    for jobs in task.seen:
        known |= set(jobs[jobs >= 0].tolist())
        waiting = len(lengths) - len(known)
        assert waiting == 0 or (jobs >= 0).all()
    assert waiting == 0


def test_lanes_are_given_up_when_no_job_waits_for_them() -> None:
    lanes, shortest = 8 * LANES, 3
    lengths = [shortest + job % 20 for job in range(2 * lanes)]
    task = Collatz(lengths)
    work_through(task, torch.arange(len(lengths)), lanes, workers=1)
    assert task.results == one_after_the_other(lengths)
    for jobs in task.seen:
        busy = int((jobs >= 0).sum())
        waiting = len(lengths) - len({*task.begun})
        assert waiting or len(jobs) <= max(LANES, 4 / 3 * busy + LANES) or jobs is task.seen[-1]
    sizes = [len(jobs) for jobs in task.seen]
    assert sizes == sorted(sizes, reverse=True)
    assert (sizes[0], sizes[-1]) == (lanes, LANES)


def test_a_loop_for_so_many_lanes_keeps_them() -> None:
    task = Collatz([1 + job % 20 for job in range(4 * LANES)])
    task.loop.any_lanes = False
    work_through(task, torch.arange(4 * LANES), 2 * LANES, workers=1)
    assert {len(jobs) for jobs in task.seen} == {2 * LANES}


@pytest.mark.parametrize(("any_lanes", "shares"), [(True, {54, 56}), (False, {64, 46})])
def test_few_jobs_are_shared_among_workers_that_can_skip_lanes(
    monkeypatch: pytest.MonkeyPatch, any_lanes: bool, shares: set[int]
) -> None:
    task, both, first = Collatz([200] * 110), Barrier(len(shares)), dict[int, int]()
    task.loop.any_lanes = any_lanes
    begin = task.begin

    def begin_together(jobs: Tensor) -> tuple[TensorDict, TensorDict]:
        if get_ident() not in first:
            first[get_ident()] = len(jobs.unique())
            both.wait(timeout=60)
        return begin(jobs)

    monkeypatch.setattr(task, "begin", begin_together)
    work_through(task, torch.arange(110), 2 * LANES, workers=2)
    assert {*first.values()} == shares


def test_only_the_jobs_that_are_given_are_done() -> None:
    task = Collatz([3] * 12)
    work_through(task, torch.tensor([7, 2, 11]), lanes=2, workers=1)
    assert task.results == {
        job: result for job, result in one_after_the_other([3] * 12).items() if job in (2, 7, 11)
    }


def test_a_keeper_sees_every_workers_hands_after_each_collect() -> None:
    class Recorder:
        def __init__(self) -> None:
            self.seen: list[tuple[int, list[int], list[int]]] = []

        def visit(self, worker: int, jobs: Tensor, state: TensorDictBase) -> None:
            busy = jobs >= 0
            self.seen.append((worker, jobs[busy].tolist(), state["left"][busy].flatten().tolist()))

    keeper = Recorder()
    work_through(Collatz([3, 1]), torch.arange(2), lanes=2, workers=1, keeper=keeper)
    assert keeper.seen == [(0, [0], [2]), (0, [0], [1]), (0, [], [])]


def test_fewer_jobs_than_lanes() -> None:
    task = Collatz([3, 1])
    work_through(task, torch.arange(2), lanes=5, workers=2)
    assert task.results == one_after_the_other([3, 1])
    assert [jobs.tolist() for jobs in task.seen] == [[0, 1, *[-1] * 3]] + 2 * [[0, *[-1] * 4]]


def test_no_jobs_at_all() -> None:
    task = Collatz([])
    work_through(task, torch.arange(0), lanes=4, workers=2)
    assert task.begun == task.seen == []


def test_gradients_are_off_in_every_worker() -> None:
    class Asking(Collatz):
        def advance(self, stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
            assert not torch.is_grad_enabled()
            return super().advance(stays, state)

    for workers in (1, 2):
        work_through(Asking([2] * 8), torch.arange(8), lanes=2, workers=workers)
    assert torch.is_grad_enabled()


class Failing(Collatz):
    """Jobs of which one fails, after every worker has received a job."""

    def __init__(self, lengths: Sequence[int], fails: int, workers: int) -> None:
        super().__init__(lengths)
        self._fails, self._all_at_work, self._failed = fails, Barrier(workers), Event()
        self._first = set(range(workers))

    def advance(self, stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        job = int(stays["job"])
        if job in self._first:
            self._first.remove(job)
            self._all_at_work.wait(timeout=10)
            if job == self._fails:
                self._failed.set()
                raise ZeroDivisionError(f"job {job}")
            self._failed.wait(timeout=10)
        return super().advance(stays, state)


@pytest.mark.parametrize(("workers", "fails"), [(1, 0), (2, 0), (2, 1)])
def test_a_workers_failure_ends_all_and_is_told(workers: int, fails: int) -> None:
    # A worker's failure is reported before the other workers have emptied the queue.
    jobs = 2_000
    task = Failing([1] * jobs, fails, workers)
    with pytest.raises(ZeroDivisionError, match=f"^job {fails}$"):
        work_through(task, torch.arange(jobs), lanes=1, workers=workers)
    assert len(task.begun) < jobs / 2


@pytest.mark.parametrize("allowed", [0, 1, 2])
def test_fewer_threads_than_workers_are_enough(
    monkeypatch: pytest.MonkeyPatch, allowed: int
) -> None:
    started, start = [], Thread.start

    def limited(thread: Thread) -> None:
        if len(started) == allowed:
            raise RuntimeError("can't start new thread")
        started.append(thread)
        start(thread)

    monkeypatch.setattr(Thread, "start", limited)
    lengths = [3, 1, 7, 2, 5, 4]
    task = Collatz(lengths)
    if allowed:
        work_through(task, torch.arange(len(lengths)), lanes=2, workers=4)
        assert task.results == one_after_the_other(lengths)
    else:
        with pytest.raises(ConfigError, match="no thread can be started here: allow more"):
            work_through(task, torch.arange(len(lengths)), lanes=2, workers=4)


class Once:
    """Jobs of a single step; ``seen`` has each lane's ``over`` at the start of every step."""

    steps = 1

    def __init__(self) -> None:
        self.seen: list[list[bool]] = []
        self.loop = AnyLanes(self.advance)

    def begin(self, jobs: Tensor) -> tuple[TensorDict, TensorDict]:
        over = torch.zeros(len(jobs), 1, dtype=torch.bool)
        return TensorDict({}, jobs.shape), TensorDict({"over": over}, jobs.shape)

    def advance(self, stays: TensorDictBase, state: TensorDictBase) -> TensorDictBase:
        self.seen.append(state["over"].squeeze(-1).tolist())
        return state

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        return torch.ones(len(jobs), dtype=torch.bool)


def test_lanes_without_a_job_are_over() -> None:
    task = Once()
    work_through(task, torch.arange(2), lanes=4, workers=1)
    assert task.seen == [[False, False, True, True]]
