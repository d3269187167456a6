"""What only some lanes need is computed in a branch; no bit of any result depends on branches."""

import random

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import Step
from fnnq_torchrl.engine.native import NativeLoop, nests
from fnnq_torchrl.engine.native.translation import source

pytestmark = pytest.mark.usefixtures("compiler")

WIDE = 30
"""The size of a dimension that becomes a loop."""


def heavy(x: Tensor, operations: int) -> Tensor:
    for n in range(operations // 2):
        x = x * 0.9 + n
    return x


def restarting(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    """Return the next state of lanes that start again when they have reached 1."""
    x = state["x"] + stays["speed"]
    start = heavy(stays["speed"] * state["episode"], 200).sin() / 2
    due = x > 1
    return TensorDict(
        {"x": torch.where(due, start, x), "episode": state["episode"] + due}, state.batch_size
    )


def example() -> tuple[TensorDict, TensorDict]:
    generator = torch.Generator().manual_seed(1)
    stays = {"speed": torch.rand(LANES, 1, generator=generator) / 4}
    stays["speed"][8:16] = 0.0  # whole vectors of lanes that never start again
    stays["wide"] = torch.rand(LANES, WIDE, generator=generator)
    state = {"x": torch.rand(LANES, 1, generator=generator), "episode": torch.zeros(LANES, 1)}
    return TensorDict(stays, [LANES]), TensorDict(state, [LANES])


def random_step(seed: int) -> Step:
    """Return a step of random operations, many of them chosen by few conditions."""

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        choose = random.Random(seed)
        numbers = [state["x"], state["episode"], stays["speed"]]
        masks = [state["x"] > 0.5, state["episode"] < 3]
        for _ in range(60):
            one, other = (choose.choice(numbers[-8:]) for _ in range(2))
            match choose.randrange(6):
                case 0 | 1:
                    new = torch.where(choose.choice(masks), one, other)
                case 2:
                    new = (one * 0.5 - other).clamp(-2, 2)
                case 3:
                    new = one + other.sin()
                case 4:
                    new = (stays["wide"] * one).sum(-1, keepdim=True).clamp(-2, 2)
                case _:
                    new = stays["wide"].gather(1, other.abs().clamp(max=WIDE - 1).long()) + one
            numbers.append(new)
            if choose.random() < 0.2:
                masks.append(new > one)
        return TensorDict(
            {"x": numbers[-1].clamp(-2, 2), "episode": numbers[-2].clamp(0, 5)}, state.batch_size
        )

    return step


def after(step: Step) -> TensorDictBase:
    stays, state = example()
    running = NativeLoop(lambda _: step, stays, state)(stays, state)
    running.advance(20)
    return running.state.clone()


def assert_branches_change_no_bit(step: Step, patch: pytest.MonkeyPatch) -> None:
    patch.setattr(nests, "_WORTH_A_BRANCH", 1)
    with_branches = after(step)
    patch.setattr(nests, "_WORTH_A_BRANCH", 10**9)
    without = after(step)
    for key in ("x", "episode"):
        assert torch.equal(with_branches[key].view(torch.int32), without[key].view(torch.int32))


@pytest.mark.parametrize("seed", range(4))
def test_random_steps(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stays, state = example()
    monkeypatch.setattr(nests, "_WORTH_A_BRANCH", 1)
    assert "if (anywhere(" in source(random_step(seed), stays[:2], state[:2])
    assert_branches_change_no_bit(random_step(seed), monkeypatch)


def test_a_start_is_computed_where_an_episode_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    stays, state = example()
    text = source(restarting, stays[:2], state[:2])
    _, branch = text.split("if (anywhere(")
    assert branch.count(" * ") > 95
    assert_branches_change_no_bit(restarting, monkeypatch)


def test_what_another_node_needs_too_is_always_computed() -> None:
    def shared(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        start = heavy(stays["speed"], 200)
        x = torch.where(state["x"] > 1, start, state["x"])
        return TensorDict({"x": x, "episode": state["episode"] + start}, state.batch_size)

    stays, state = example()
    assert "if (anywhere(" not in source(shared, stays[:2], state[:2])


def test_a_condition_of_a_small_part_is_no_branch() -> None:
    def small(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        start = heavy(state["x"], 40)
        x = torch.where(state["x"] > 1, start, state["x"])
        return TensorDict({"x": x, "episode": state["episode"]}, state.batch_size)

    stays, state = example()
    assert "if (anywhere(" not in source(small, stays[:2], state[:2])
