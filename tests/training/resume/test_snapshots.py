import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.training.resume.snapshots import SnapshotBook
from tests.programs import advance, config, make_learner, make_runs

RUNS, EVALUATIONS = 9, 4


@torch.no_grad()
def test_every_page_has_the_weights_right_at_that_moment() -> None:
    settings = config("evaluation.every=2", "situations=6")
    run = make_runs(settings, RUNS, lam=torch.linspace(0, 1, RUNS))
    learner = make_learner(settings, run)
    state = learner.begin(run)
    book = SnapshotBook(
        state["weights"], dict(state["snapshot", "told"].items()), every=2, evaluations=EVALUATIONS
    )
    numbers = torch.randperm(RUNS, generator=torch.Generator().manual_seed(0))  # run of each lane
    chunk = 2 * learner.env.world.fewest_steps

    weights = {(0, i): state["weights", "weight"][i] for i in range(RUNS)}
    steps = {(0, i): 0 for i in range(RUNS)}
    alphas = {(0, i): run["alpha"][i] for i in range(RUNS)}
    while state["situations"].min() < 8:  # runs go on after their last evaluation
        for _ in range(chunk):
            state = learner.step(run, state)
            for i in range(RUNS):
                situations = int(state["situations"][i])
                if situations % 2 == 0 and (situations // 2, i) not in weights:
                    weights[situations // 2, i] = state["weights", "weight"][i]
                    steps[situations // 2, i] = int(state["steps"][i])
                    alphas[situations // 2, i] = state["alpha"][i]
        book.collect(numbers, state)
    assert book.pages.batch_size == (EVALUATIONS, RUNS)
    for page in range(EVALUATIONS):
        for i in range(RUNS):
            its = book.pages[page, numbers[i]]
            assert torch.equal(its["weights", "weight"], weights[page, i])
            assert its["steps"] == steps[page, i]
            assert its["alpha"] == alphas[page, i]


def state_at(situations: list[int], snapshot: list[float]) -> TensorDict:
    """Return a state in which each run's snapshot is one number."""
    runs = len(situations)
    return TensorDict(
        {
            "situations": torch.tensor(situations).unsqueeze(-1),
            "snapshot": {
                "weights": {
                    "a": torch.tensor(snapshot).float().view(runs, 1, 1).expand(runs, 2, 3),
                    "b": torch.tensor(snapshot).float().view(runs, 1),
                },
                "steps": torch.tensor(snapshot).long().unsqueeze(-1),
            },
        },
        batch_size=[runs],
    )


def test_runs_turn_their_pages_at_their_own_pace() -> None:
    book = blank_book(runs=2)
    both = torch.tensor([0, 1])
    book.collect(both, state_at([4, 5], [9, 2]))  # 9: not yet due
    book.collect(both, state_at([6, 9], [3, 9]))  # 9: collected before
    book.collect(both, state_at([14, 11], [4, 5]))
    book.collect(both, state_at([15, 25], [9, 9]))  # after the last
    assert_pages(book, [[1, 1], [3, 2], [4, 5]])


def test_runs_that_take_turns_on_a_lane() -> None:
    book = blank_book(runs=4)
    book.collect(torch.tensor([0, 1]), state_at([5, 5], [2, 8]))
    book.collect(torch.tensor([-1, 1]), state_at([10, 10], [9, 3]))
    book.collect(torch.tensor([2, -1]), state_at([5, 10], [4, 9]))  # 9: a lane with nothing to do
    book.collect(torch.tensor([2, 3]), state_at([10, 4], [5, 9]))  # 9: not due for run 3
    assert_pages(book, [[1, 1, 1, 1], [2, 8, 4, 0], [0, 3, 5, 0]])


def blank_book(runs: int) -> SnapshotBook:
    weights = state_at([0] * runs, [1] * runs)["snapshot", "weights"]
    return SnapshotBook(weights, {}, every=5, evaluations=3)


def assert_pages(book: SnapshotBook, numbers: list[list[float]]) -> None:
    """Check that a book's snapshots and steps are these numbers, with 0 steps before learning."""
    expected = torch.tensor(numbers).float()
    assert torch.equal(book.pages["steps"][1:], expected[1:].long())
    assert (book.pages["steps"][0] == 0).all()
    assert torch.equal(book.pages["weights", "b"], expected.unsqueeze(-1))
    assert torch.equal(
        book.pages["weights", "a"], expected.view(*expected.shape, 1, 1).expand(-1, -1, 2, 3)
    )


@pytest.mark.parametrize("every", [1, 5])
@torch.no_grad()
def test_a_snapshot_waits_until_the_next_is_due(every: int) -> None:
    settings = config(f"evaluation.every={every}", f"situations={every}")
    run = make_runs(settings, RUNS)
    learner = make_learner(settings, run)
    state = advance(learner, run, 0)
    for _ in range(80):
        before, state = state, learner.step(run, state)
        ended = (state["situations"] > before["situations"]).squeeze(-1)
        due = ended & (state["situations"].squeeze(-1) % every == 0)
        snapshot, now = state["snapshot", "weights", "weight"], state["weights", "weight"]
        assert torch.equal(snapshot[due], now[due])
        assert torch.equal(snapshot[~due], before["snapshot", "weights", "weight"][~due])
        for count in ("situations", "steps"):
            assert torch.equal(state["snapshot", count][due], state[count][due])
    assert state["situations"].min() >= 5


def test_a_snapshot_that_nobody_collected_is_told() -> None:
    """This happens if the episodes take fewer steps than the world's ``fewest_steps``."""
    book = blank_book(runs=2)
    runs = torch.tensor([0, 1])
    with pytest.raises(ConfigError, match="the world's fewest_steps must"):
        book.collect(runs, state_at([10, 5], [1.0, 1.0]))
