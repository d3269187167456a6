import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl.snapshots import SnapshotBook

from .programs import advance, config, make_program, make_runs

RUNS, EVALUATIONS = 9, 4


@torch.no_grad()
def test_every_page_has_the_weights_right_at_that_moment() -> None:
    settings = config("evaluation.every=2", "situations=6")
    run = make_runs(settings, RUNS, lam=torch.linspace(0, 1, RUNS))
    program = make_program(settings, run)
    state = program.begin(run)
    book = SnapshotBook(state, every=2, evaluations=EVALUATIONS)
    chunk = 2 * program.env.fewest_steps

    weights = {(0, i): state["weights", "weight"][i] for i in range(RUNS)}
    steps = {(0, i): 0 for i in range(RUNS)}
    while state["situations"].min() < 6:
        for _ in range(chunk):
            state = program.step(run, state)
            for i in range(RUNS):
                situations = int(state["situations"][i])
                if situations % 2 == 0 and (situations // 2, i) not in weights:
                    weights[situations // 2, i] = state["weights", "weight"][i]
                    steps[situations // 2, i] = int(state["steps"][i])
        book.collect(state)
    assert book.pages.batch_size == (EVALUATIONS,)
    assert state["situations"].max() >= 8  # some go on after their last evaluation
    for page in range(EVALUATIONS):
        for i in range(RUNS):
            assert torch.equal(book.pages["weights", "weight"][page, ..., i], weights[page, i])
            assert book.pages["steps"][page, i] == steps[page, i]


def state_at(situations: list[int], snapshot: list[float]) -> TensorDict:
    """A program's state in which each run's snapshot is one number."""
    runs = len(situations)
    return TensorDict(
        {
            "situations": torch.tensor(situations).unsqueeze(-1),
            "snapshot": {
                "weights": {
                    "a": torch.tensor(snapshot).view(runs, 1, 1).expand(runs, 2, 3),
                    "b": torch.tensor(snapshot).view(runs, 1),
                },
                "steps": torch.tensor(snapshot).long().unsqueeze(-1),
            },
        },
        batch_size=[runs],
    )


def test_runs_turn_their_pages_at_their_own_pace() -> None:
    book = SnapshotBook(state_at([0, 0], [1, 1]), every=5, evaluations=3)
    book.collect(state_at([4, 5], [9, 2]))  # 9: not yet due
    book.collect(state_at([6, 9], [3, 9]))  # 9: collected before
    book.collect(state_at([14, 11], [4, 5]))
    book.collect(state_at([15, 25], [9, 9]))  # after the last
    expected = torch.tensor([[1, 1], [3, 2], [4, 5]])
    assert torch.equal(book.pages["steps"], expected)
    assert torch.equal(book.pages["weights", "b"], expected.float().unsqueeze(1))
    assert torch.equal(book.pages["weights", "a"][:, 1, 2], expected.float())


@pytest.mark.parametrize("every", [1, 5])
@torch.no_grad()
def test_a_snapshot_waits_until_the_next_is_due(every: int) -> None:
    settings = config(f"evaluation.every={every}", f"situations={every}")
    run = make_runs(settings, RUNS)
    program = make_program(settings, run)
    state = advance(program, run, 0)
    for _ in range(80):
        before, state = state, program.step(run, state)
        ended = (state["situations"] > before["situations"]).squeeze(-1)
        due = ended & (state["situations"].squeeze(-1) % every == 0)
        snapshot, now = state["snapshot", "weights", "weight"], state["weights", "weight"]
        assert torch.equal(snapshot[due], now[due])
        assert torch.equal(snapshot[~due], before["snapshot", "weights", "weight"][~due])
        assert torch.equal(state["snapshot", "steps"][due], state["steps"][due])
    assert state["situations"].min() >= 5
