"""The ball that changes while the runs learn: afterwards it is another world, in tests too."""

from dataclasses import replace

import pytest
import torch
from tensordict import TensorDict

from envs.worlds import make_world
from fnnq_torchrl.training.evaluation import FIRST_EPISODE, world_of_tests
from fnnq_torchrl.training.trainer import Trainer
from tests.programs import config

RUNS, STEPS, CHANGE = 5, 12, 3


def course(world, episode: int, reverse: float, faster: float) -> list[TensorDict]:
    """Return the states of a situation with random actions, times ``reverse``."""
    env = make_world(world, [RUNS], seed=4, dtype=torch.float64)
    seed = torch.arange(RUNS).unsqueeze(-1)
    state = env.start(seed, torch.full_like(seed, episode))
    state["ball_speed_radps"] *= faster
    generator = torch.Generator().manual_seed(episode)
    states = []
    for _ in range(STEPS):
        action = 2 * torch.rand(RUNS, 1, generator=generator, dtype=torch.float64) - 1
        state = env.step(state.set("action", reverse * action))["next"]
        states.append(state.exclude("ball_speed_radps"))
    return states


@pytest.mark.parametrize("episode", [CHANGE - 1, CHANGE, CHANGE + 1])
@pytest.mark.parametrize(
    ("change", "reverse", "faster"),
    [({"swap_wheels": True}, -1, 1), ({"changed_speed": 1.7}, 1, 1.7)],
    ids=["wheels", "speed"],
)
def test_it_is_another_world_from_then_on(
    episode: int, change: dict, reverse: float, faster: float
) -> None:
    usual = config().env
    changing = replace(usual, change_at=CHANGE, **change)
    if episode < CHANGE:
        reverse, faster = 1, 1
    expected = course(usual, episode, reverse, faster)
    for one, other in zip(course(changing, episode, 1, 1), expected, strict=True):
        assert torch.equal(one["bearing"], other["bearing"])
        assert torch.equal(one["x_m"], other["x_m"])


@pytest.mark.parametrize(("change_at", "first"), [(10, 2), (11, 3), (14, 3), (15, 3)])
def test_evaluations_play_in_the_changed_world_from_the_change_on(
    change_at: int, first: int
) -> None:
    """There are five tests in an evaluation, after every five situations."""
    world = world_of_tests(config("env.swap_wheels=true", f"env.change_at={change_at}"))
    assert world.change_at == FIRST_EPISODE + 5 * first
    assert world_of_tests(config()) is config().env


def test_what_was_learned_before_the_change_is_tested_in_the_new_world() -> None:
    """Without learning (α = 0), scores change from the first evaluation after the change on."""
    settings = ("alpha=0", "situations=20", "num_seeds=2", "engine=eager")
    still, changed = (
        Trainer.of(config(*settings, *change))
        for change in ((), ("env.change_at=10", "env.changed_speed=40"))
    )
    for trainer in (still, changed):
        trainer.learn()
    before, after = (trainer.evaluate().lengths for trainer in (still, changed))
    assert (before[:, :2] == after[:, :2]).all()
    assert (before[:, 2:] != after[:, 2:]).any()
