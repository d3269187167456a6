"""Any Gymnasium environment as a world."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete, MultiDiscrete
from torchrl.envs import check_env_specs

from envs import PureEnv, make_world
from envs.core.contract import check_world
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.engine.choice import choose_engine
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.trainer import Trainer
from tests.commands import fnnq_train
from tests.compositions import config_of

CAR = ("task=gymnasium", "env.id=MountainCarContinuous-v0", "action=even", "value=tiles")


class Cuts(gymnasium.Env):
    """An environment whose episodes are cut off after three steps, with actions from 1."""

    observation_space = Discrete(3, start=5)
    action_space = Discrete(2, start=1)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.steps = 0
        return self.np_random.integers(3) + 5, {}

    def step(self, action):
        assert self.action_space.contains(action)
        self.steps += 1
        return 5, float(action), False, self.steps == 3, {}


class Two(Cuts):
    action_space = MultiDiscrete([2, 2])


class Picture(Cuts):
    observation_space = Box(0, 1, (2, 2))


@pytest.fixture(autouse=True, scope="module")
def _registered():
    for each in (Cuts, Two, Picture):
        gymnasium.register(f"tests/{each.__name__}-v0", each)
    yield
    for each in (Cuts, Two, Picture):
        del gymnasium.registry[f"tests/{each.__name__}-v0"]


def make(*overrides: str, runs: int = 3) -> PureEnv:
    config = config_of("task=gymnasium", *overrides)
    return make_world(config.env, [runs], seed=7, dtype=torch.float64)


@pytest.mark.parametrize("name", ["CartPole-v1", "tests/Cuts-v0", "Pendulum-v1"])
def test_it_is_an_environment(name: str) -> None:
    action = ["action=even"] * (name == "Pendulum-v1")
    env = make(f"env.id={name}", *action)
    check_env_specs(env)
    check_world(env)


def test_its_steps_are_the_environments() -> None:
    runs = 2
    env = make("env.id=Acrobot-v1", runs=runs)
    theirs = [gymnasium.make("Acrobot-v1") for _ in range(runs)]
    state = env.reset()
    for i, each in enumerate(theirs):
        each.reset(seed=0)
        # The same start: the angles from their sines and cosines, then the speeds.
        cosine1, sine1, cosine2, sine2, *speeds = (state[key][i].item() for key in env.seen)
        angles = np.arctan2(sine1, cosine1), np.arctan2(sine2, cosine2)
        each.unwrapped.state = np.array([*angles, *speeds], dtype=np.float32)
    for step in range(20):
        action = torch.tensor([[step % 3], [2]], dtype=torch.float64)
        state = env.step(state.set("action", action))["next"]
        for i, each in enumerate(theirs):
            seen, reward, *_ = each.step(int(action[i]))
            ours = np.array([state[key][i].item() for key in env.seen])
            np.testing.assert_allclose(ours, seen, atol=1e-4)
            assert reward == state["reward"][i].item()


def test_a_state_is_all_that_another_environment_needs_to_go_on() -> None:
    """As after an interruption: the other one plays the same actions first."""
    one, other = make(), make()
    state = one.reset()
    for _ in range(8):
        action = (state["chance"] * 2).floor()
        state = one.restart(one.step(state.set("action", action))["next"])
    action = torch.ones(3, 1, dtype=torch.float64)
    ours, its = (env.step(state.clone().set("action", action))["next"] for env in (one, other))
    assert (ours == its).all()
    assert ours["step"].min() == 9


def test_a_run_depends_on_its_seed_alone_and_each_episode_is_another() -> None:
    env = make("env.time_limit_steps=2", runs=4)
    seeds = torch.tensor([5, 5, 6, 7]).unsqueeze(-1)
    state = env.start(seeds, torch.zeros_like(seeds))
    starts = [state]
    for _ in range(2):
        for _ in range(2):
            action = torch.zeros(4, 1, dtype=torch.float64)
            after = env.step(state.set("action", action))["next"]
            state = env.restart(after)
        assert after["truncated"].all()
        assert (state["step"] == 0).all()
        assert (state["history"] == 0).all()
        starts.append(state)
    x0 = torch.stack([each["x0"] for each in starts]).squeeze(-1)
    assert torch.equal(x0[:, 0], x0[:, 1])
    assert len({*x0[:, 1:].flatten().tolist()}) == 9


def test_an_end_that_the_environment_sets_itself_is_a_truncation() -> None:
    env = make("env.id=tests/Cuts-v0", runs=2)
    assert (env.world.observations, env.world.actions) == ({"x0": (5.0, 7.0)}, 2)
    state = env.reset()
    for step in (1, 2, 3):
        state = env.step(state.set("action", torch.tensor([[0.0], [1.0]]).double()))["next"]
        assert state["reward"].flatten().tolist() == [1.0, 2.0]
        assert (state["truncated"] == (step == 3)).all()
    assert not state["terminated"].any()


def test_ranges_are_the_spaces_or_those_of_a_warm_up() -> None:
    world = make().world
    low, high = world.observations["x1"]
    assert (low, high) == (-float("inf"), float("inf"))
    low, high = world.usual["x1"]
    assert -10 < low < -0.5 < 0.5 < high < 10
    assert world.usual["x2"] == world.observations["x2"]
    tiles = config_of("task=gymnasium", "value=tiles", "value.tiles=2").value
    assert tiles.inputs["x1"] == [low, high]


def test_it_learns() -> None:
    trainer = Trainer.of(config_of(*CAR, "situations=5", "num_seeds=2", "env.time_limit_steps=9"))
    trainer.learn()
    outcome = trainer.evaluate()
    assert (outcome.steps[:, -1] == 45).all()
    assert trainer.weights["weight"].any()


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (("env.id=Maze-v0",), r"env\.id=Maze-v0: Environment `Maze` doesn't exist\."),
        (("env.id=tests/Two-v0",), r"its action must be Discrete or one bounded number, not Multi"),
        (("env.id=tests/Picture-v0",), r"its observations must be a row of numbers, not Box"),
        (("env.id=a b",), r"env\.id=a b: must be the name of an environment"),
    ],
)
def test_what_does_not_suit_is_told_in_one_line(overrides: tuple[str, ...], line: str) -> None:
    with pytest.raises(ConfigError, match=line) as refused:
        load_config("task=gymnasium", *overrides)
    assert "\n" not in str(refused.value)


def test_it_runs_eagerly_and_refuses_to_be_compiled() -> None:
    assert choose_engine(config_of("task=gymnasium"), 1_000).name == "eager"
    with pytest.raises(ConfigError, match="engine=compiled: env=gymnasium isn't plain torch"):
        choose_engine(load_config("task=gymnasium", "engine=compiled"), 1)


def test_it_is_one_command(tmp_path, capsys) -> None:
    words = ("task=gymnasium", "env.id=CartPole-v1", "situations=5", "env.time_limit_steps=6")
    assert fnnq_train(*words, f"hydra.run.dir={tmp_path}", "evaluation=none") == 0
    assert (tmp_path / "evaluations.csv").exists()


def test_the_time_limit_is_the_registrys_unless_another_is_given() -> None:
    assert make().world.time_limit_steps == 500
    assert make("env.id=MountainCar-v0").world.time_limit_steps == 200
    assert make("env.id=tests/Cuts-v0").world.time_limit_steps == 1_000
    assert make("env.time_limit_steps=7").world.time_limit_steps == 7
