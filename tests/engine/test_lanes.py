"""A run depends on its own configuration and seed alone, bit for bit."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict

from fnnq_torchrl.engine.lanes import LANES, lanes_for, share
from tests.programs import advance, config, in_lanes, make_learner, make_runs

RUNS, STEPS = 22, 150


@given(st.integers(1, 200))
def test_padding_repeats_the_last_run_up_to_whole_lanes(runs: int) -> None:
    values = torch.arange(2 * runs).view(runs, 2)
    padded = in_lanes(values)
    assert len(padded) % LANES == 0
    assert len(padded) - runs < LANES
    assert torch.equal(padded[:runs], values)
    assert (padded[runs:] == values[-1]).all()


some_jobs = st.integers(1, 10**6)
some_workers = st.integers(1, 64)
some_most = st.integers(1, 4096).map(lambda units: LANES * units)


@given(some_jobs, some_workers, some_most)
def test_lanes_are_whole_and_enough_for_all_jobs_unless_that_is_too_many(
    jobs: int, workers: int, most: int
) -> None:
    lanes = lanes_for(jobs, workers, most)
    assert lanes % LANES == 0
    assert LANES <= lanes <= most
    assert lanes == most or workers * lanes >= jobs


@given(some_jobs, some_workers)
def test_few_lanes_are_idle(jobs: int, workers: int) -> None:
    lanes = lanes_for(jobs, workers, most=2**30)
    assert lanes <= 1.25 * (jobs / workers) + LANES


@given(st.integers(1, 10**5), some_workers)
def test_there_are_four_sizes_from_a_number_to_its_double(jobs: int, workers: int) -> None:
    # With few sizes, a program compiled for one number of jobs serves many others.
    units = range(jobs, 2 * jobs, max(1, jobs // 1000))
    sizes = {lanes_for(LANES * workers * n, workers, most=2**30) for n in units}
    assert len(sizes) <= 5  # both ends count


@given(some_jobs, some_workers)
def test_workers_begin_with_equal_shares_in_whole_vectors(jobs: int, workers: int) -> None:
    each = share(jobs, workers)
    assert each % 8 == 0
    assert each >= LANES
    assert jobs <= each * workers
    assert each == LANES or each * workers < jobs + 8 * workers


@contextmanager
def on_threads(count: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    yield
    torch.set_num_threads(before)


def learn(run: TensorDict, steps: int) -> TensorDict:
    """Return the state of these runs after some steps, without padding."""
    lanes = in_lanes(run)
    return advance(make_learner(config(), lanes), lanes, steps)[: len(run)]


def assert_same_bits(state: TensorDict, other: TensorDict) -> None:
    leaves, others = (dict(td.items(True, True)) for td in (state, other))
    assert leaves.keys() == others.keys()
    different = [key for key in leaves if not torch.equal(leaves[key], others[key])]
    assert not different


@pytest.fixture(scope="module")
def together() -> tuple[TensorDict, TensorDict]:
    """Return runs of the default configuration, and their state after learning side by side."""
    run = make_runs(config(), RUNS)
    return run, learn(run, STEPS)


def test_alone_or_in_a_batch(together: tuple[TensorDict, TensorDict]) -> None:
    run, state = together
    assert_same_bits(learn(run[13:14], STEPS), state[13:14])


def test_among_runs_of_other_configurations(together: tuple[TensorDict, TensorDict]) -> None:
    run, state = together
    count = 75  # enough to change the number of lanes too
    others = make_runs(
        config(),
        count,
        seed=torch.arange(1000, 1000 + count),
        lam=torch.linspace(0, 1, count),
        alpha=torch.linspace(0, 2, count),
        alpha_decay=torch.linspace(0.1, 1, count),
        gamma=torch.linspace(0, 1, count),
        epsilon=torch.linspace(0, 1, count),
    )
    order = torch.randperm(count + RUNS, generator=torch.Generator().manual_seed(0))
    mixed = learn(torch.cat([run, others])[order], STEPS)
    assert_same_bits(mixed[order.argsort()[:RUNS]], state)


@pytest.mark.parametrize(("runs", "threads"), [(50, 3), (600, 2)])
def test_on_any_number_of_threads(runs: int, threads: int) -> None:
    # From about 400 runs on there is enough work in an operation for torch to share it out.
    run = make_runs(config(), runs)
    with on_threads(1):
        state = learn(run[:RUNS], 20)
    with on_threads(threads):
        assert_same_bits(learn(run, 20)[:RUNS], state)
