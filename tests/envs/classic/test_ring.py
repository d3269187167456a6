"""The ring: its steps, its best mean reward in closed form, and its switch."""

from dataclasses import replace
from itertools import product

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torchrl.envs import check_env_specs

from envs import PureEnv, check_world, make_world
from tests.compositions import config_of
from tests.oracles.ring import ring_step


def make(*overrides: str, runs: int = 1) -> PureEnv:
    config = config_of("task=ring", *overrides)
    return make_world(config.env, [runs], seed=3, dtype=torch.float64)


def test_it_is_an_environment() -> None:
    env = make("env.situation_steps=5", runs=3)
    check_env_specs(env)
    check_world(env)


@pytest.mark.parametrize(("states", "far"), [(2, 3), (4, 6), (9, 0.5)])
def test_every_step_is_the_twins(states: int, far: float) -> None:
    env = make(f"env.states={states}", f"env.far_reward={far}", runs=2 * states)
    start = env.reset()
    assert (start["state"] == states // 2).all()
    state = torch.arange(states).repeat(2)
    action = torch.arange(2).repeat_interleave(states)
    given = start.set("state", state[:, None].double()).set("action", action[:, None].double())
    after = env.step(given)["next"]
    found = torch.cat([after["state"], after["reward"]], -1).tolist()
    pairs = torch.stack([state, action], -1).tolist()
    assert found == [[*ring_step(*pair, states, far)] for pair in pairs]
    assert not after["done"].any()


def best_cycle(states: int, far: float) -> float:
    """Return the best mean reward of all policies without memory, each followed into its cycle."""
    best = -float("inf")
    for policy in product((0, 1), repeat=states):
        state, rewards, seen = 0, [], {}
        while state not in seen:
            seen[state] = len(rewards)
            state, reward = ring_step(state, policy[state], states, far)
            rewards.append(reward)
        cycle = rewards[seen[state] :]
        best = max(best, sum(cycle) / len(cycle))
    return best


RING = config_of("task=ring").env


@given(states=st.integers(2, 6), far=st.integers(-8, 8))
def test_the_best_mean_reward_is_that_of_the_best_policy(states: int, far: int) -> None:
    ring = replace(RING, states=states, far_reward=far)
    env = make_world(ring, [1], seed=3, dtype=torch.float64)
    step = torch.ones(1, 1, dtype=torch.int64)
    assert env.best_mean(step).item() == pytest.approx(best_cycle(states, far))


def test_the_reward_switches_after_a_number_of_steps() -> None:
    switch = ("env.switch_after_steps=2", "env.switched_reward=12")
    env = make("env.states=3", "env.far_reward=2", *switch)
    state, rewards, best = env.reset(), [], []
    for _ in range(5):  # from state 1 to the left
        after = env.step(state.set("action", torch.zeros(1, 1).double()))["next"]
        rewards.append(after["reward"].item())
        best.append(env.best_mean(after["step"]).item())
        state = env.restart(after)
    assert rewards == [-1, 2, -1, -1, 12]
    assert best == [0, 0, *[10 / 3] * 3]
