"""The classic worlds take the same steps as Gymnasium's environments of the same names."""

import gymnasium
import numpy as np
import pytest
import torch
from torchrl.envs import check_env_specs

from envs import PureEnv, check_world, make_world
from fnnq_torchrl.training.trainer import Trainer
from tests.compositions import config_of

WORLDS = {
    "mountain_car_gymnasium": ("mountain_car", "MountainCar-v0", {}, "velocity"),
    "cart_pole_gymnasium": ("cart_pole", "CartPole-v1", {}, "cart_mps"),
    "cart_pole": ("cart_pole", "CartPole-v1", {"sutton_barto_reward": True}, "cart_mps"),
    "acrobot": ("acrobot", "Acrobot-v1", {}, "speed2_radps"),
}
"""Each world's task, Gymnasium's environment and its settings, and a speed to push along."""


def make(task: str, *overrides: str, runs: int) -> PureEnv:
    config = config_of(f"task={task}", *overrides)
    return make_world(config.env, [runs], seed=3, dtype=torch.float64)


@pytest.mark.parametrize("name", WORLDS)
@pytest.mark.parametrize(
    ("starts", "steps"), [(8, 250), pytest.param(100, 1_000, marks=pytest.mark.long)]
)
def test_the_steps_are_gymnasiums(name: str, starts: int, steps: int) -> None:
    """Half of the runs act at random, half push along the speed; all begin again after an end."""
    task, of_gymnasium, settings, speed = WORLDS[name]
    env = make(task, f"env={name}", runs=starts)
    theirs = [gymnasium.make(of_gymnasium, **settings) for _ in range(starts)]
    assert theirs[0].spec.max_episode_steps == env.world.time_limit_steps
    rng, pushes = np.random.default_rng(1), np.arange(starts) % 2 == 0
    state = env.reset()
    for i, each in enumerate(theirs):
        each.reset(seed=i)
        each.unwrapped.state = numbers(env, state)[i]
    ends = 0
    for _ in range(steps):
        along = (env.world.actions - 1) * (state[speed].squeeze(-1).numpy() > 0)
        actions = np.where(pushes, along, rng.integers(env.world.actions, size=starts))
        given = torch.tensor(actions, dtype=torch.float64).unsqueeze(-1)
        after = env.step(state.set("action", given))["next"]
        ours = numbers(env, after)
        for i, each in enumerate(theirs):
            _, reward, terminated, truncated, _ = each.step(actions[i])
            np.testing.assert_allclose(ours[i], each.unwrapped.state, rtol=1e-9, atol=1e-12)
            told = (reward, terminated, truncated and not terminated)
            found = (after[key][i].item() for key in ("reward", "terminated", "truncated"))
            assert told == tuple(found)
            each.unwrapped.state = ours[i].copy()  # differences grow fast
        state = env.restart(after)
        for i in after["done"].squeeze(-1).nonzero().flatten().tolist():
            theirs[i].reset()
            theirs[i].unwrapped.state = numbers(env, state)[i]
            ends += int(after["terminated"][i])
    assert ends > 0


def numbers(env: PureEnv, state) -> np.ndarray:
    return torch.cat([state[key] for key in env.seen], -1).numpy().copy()


@pytest.mark.parametrize(
    "task", ["mountain_car", "cart_pole", "acrobot", "random_walk", "chain", "two_states"]
)
def test_it_is_an_environment(task: str) -> None:
    env = make(task, runs=3)
    check_env_specs(env)
    check_world(env)


def test_the_car_stops_at_the_wall() -> None:
    env = make("mountain_car", runs=1)
    state = env.reset()
    state["position"][:], state["velocity"][:] = -1.19, -0.06
    after = env.step(state.set("action", torch.zeros(1, 1, dtype=torch.float64)))["next"]
    assert (after["position"].item(), after["velocity"].item()) == (-1.2, 0.0)


@pytest.mark.parametrize("task", ["mountain_car", "random_walk"])
def test_no_episode_is_shorter_than_the_fewest_steps(task: str) -> None:
    """The bound is reached by the walk, and the best drive needs some more steps than its own."""
    env = make(task, runs=400)
    steps = torch.zeros(0)
    state = env.reset()
    for _ in range(300):
        # the car pushes along its speed, which is the quickest way out
        action = 2 * (state["velocity"] >= 0).double() if task == "mountain_car" else 0
        after = env.step(state.set("action", torch.zeros(400, 1).double() + action))["next"]
        steps = torch.cat([steps, after["step"][after["done"]]])
        state = env.restart(after)
    fewest = env.world.fewest_steps
    assert fewest <= steps.min() < {"mountain_car": 150, "random_walk": fewest + 8}[task]


def test_the_walk_goes_either_way_and_ends_with_its_rewards() -> None:
    env = make("random_walk", "env.states=3", runs=1_000)
    state = env.reset()
    assert (state["place"] == 2).all()
    action = torch.zeros(1_000, 1, dtype=torch.float64)
    right = env.step(state.set("action", action))["next"]
    assert 400 < (right["place"] == 3).sum() < 600
    assert (right["place"] != 2).all()
    after = env.step(right.set("action", action))["next"]
    ends = {0: -1.0, 2: 0.0, 4: 1.0}
    for place, reward in ends.items():
        here = after["place"] == place
        assert here.any()
        assert (after["reward"][here] == reward).all()
        assert (after["terminated"][here] == (place != 2)).all()
        assert (after["success"][here] == (place == 4)).all()


@pytest.mark.long
@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize(
    ("overrides", "least"),
    [
        (("task=mountain_car",), -170),
        (("task=mountain_car", "value=tiles"), -135),
        (("task=cart_pole",), 9),
        (("task=cart_pole", "value=tiles"), 6),
        (("task=acrobot",), -280),
        (("task=acrobot", "value=tiles"), -130),
    ],
)
def test_a_task_is_learned_with_its_defaults(overrides: tuple[str, ...], least: float) -> None:
    trainer = Trainer.of(config_of(*overrides, "num_seeds=32", "evaluation.every=20"))
    trainer.learn()
    outcome = trainer.evaluate()
    assert outcome.diverged_runs == 0
    assert outcome.final_score.mean() > least


@pytest.mark.usefixtures("compiler")
def test_the_walks_values_are_predicted() -> None:
    """With a small step the mean values come near the true ones, of which the first is −0.9."""
    slowly = ("alpha=0.03", "situations=400", "num_seeds=256", "engine=compiled")
    trainer = Trainer.of(config_of("task=random_walk", *slowly))
    trainer.learn()
    found = trainer.weights["weight"].mean(0).flatten().double().numpy()
    np.testing.assert_allclose(found, np.arange(-9, 10) / 10, atol=0.06)


def test_acrobot_is_observed_as_in_gymnasium() -> None:
    env = make("acrobot", "env.cosines=true", "value=mlp", runs=1)
    check_world(make("acrobot", "env.cosines=true", "value=mlp", runs=2))
    theirs = gymnasium.make("Acrobot-v1").unwrapped
    theirs.reset(seed=0)
    state = env.reset()
    theirs.state = np.array(
        [state[key].item() for key in ("angle1_rad", "angle2_rad", "speed1_radps", "speed2_radps")]
    )
    for step in range(100):
        action = step // 7 % 3
        state = env.step(state.set("action", torch.full((1, 1), action).double()))["next"]
        seen, *_ = theirs.step(action)
        ours = np.array([state[key].item() for key in env.seen])
        np.testing.assert_allclose(ours, seen, atol=1e-6)
