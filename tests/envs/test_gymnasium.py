"""The world with Gymnasium's interface passes Gymnasium's checker and is the same world."""

import subprocess
import sys
from dataclasses import replace
from functools import partial

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.core.parameters import OutOfRange
from envs.gymnasium import GymWorld, GymWorlds
from envs.robot.follow import FollowBall
from envs.robot.schemas import FollowBallConfig
from fnnq_torchrl.launch import registration

CANDIDATES = 21


@pytest.fixture
def env(world: FollowBallConfig) -> GymWorld:
    return GymWorld(world, CANDIDATES)


def test_gymnasiums_checker_finds_nothing(world, monkeypatch):
    """The world is made by `gymnasium.make`, since some checks need a spec."""
    monkeypatch.setattr(gymnasium.envs.registration, "registry", {})
    gymnasium.register("FollowBall-v0", GymWorld)
    made = gymnasium.make("FollowBall-v0", config=world, candidates=CANDIDATES)
    check_env(made.unwrapped)


@settings(max_examples=5)
@given(seed=st.integers(0, 2**63 - 1), chooser=st.integers(0, 2**32 - 1))
def test_it_is_the_same_world_bit_for_bit(seed, chooser, world):
    """The same actions give the same history as FollowBall, until two situations have ended."""
    env = GymWorld(world, CANDIDATES)
    twin = FollowBall(world, seed=torch.tensor(seed))
    choose = np.random.default_rng(chooser)
    candidates = torch.linspace(-1, 1, CANDIDATES)
    seen, info = env.reset(seed=seed)
    state = twin.reset()
    ends = 0
    while ends < 2:
        assert seen.tolist() == state["bearing"].tolist()
        # Roughly towards the ball, so that some situations end in a catch.
        towards = 0.5 - 2.5 * seen[0] + choose.normal(scale=0.2)
        action = np.int64(np.clip(round(20 * towards), 0, 20))
        seen, reward, terminated, truncated, info = env.step(action)
        state = twin.step(state.set("action", candidates[action].view(1)))["next"]
        assert (reward, terminated) == (state["reward"].item(), state["terminated"].item())
        assert info == {"is_success": reward == world.catch_reward}
        assert not truncated
        if terminated:
            assert seen.tolist() == state["bearing"].tolist()
            ends += 1
            seen, info = env.reset()
            state = twin.reset()
            assert info == {"is_success": False}


def test_a_situation_is_found_again_by_its_seed_and_number(env):
    env.reset(seed=5)
    wanted = [env.reset()[0] for _ in range(3)]
    env.reset(seed=6)
    assert env.reset(seed=5, options={"episode": 2})[0] == wanted[1]
    assert env.reset()[0] == wanted[2]


def test_unseeded_worlds_differ_and_keep_their_seed(world):
    one, other = (GymWorld(world, CANDIDATES) for _ in range(2))
    first, second = ([env.reset()[0].item() for _ in range(3)] for env in (one, other))
    assert len({*first, *second}) == 6
    assert one.reset(options={"episode": 0})[0].item() == first[0]


def test_a_vector_of_worlds_is_not_one_world_many_times(world):
    worlds = gymnasium.vector.SyncVectorEnv([partial(GymWorld, world, CANDIDATES)] * 4)
    assert len(np.unique(worlds.reset()[0])) == 4
    assert len(np.unique(worlds.reset(seed=3)[0])) == 4


def test_a_start_can_be_given(env, world):
    """The next situation has a random start again."""
    seen, _ = env.reset(seed=1, options={"start": (0.8, 0.1), "episode": 2**32})
    number = torch.tensor([2**32])
    twin = FollowBall(world, seed=0).start(torch.tensor([1]), number, torch.tensor([0.8, 0.1]))
    assert seen.tolist() == twin["bearing"].tolist()
    assert abs(seen[0] - 0.8) < 0.06
    seen, _ = env.reset()
    assert (
        seen.tolist()
        == FollowBall(world, seed=0).start(torch.tensor([1]), number + 1)["bearing"].tolist()
    )


@pytest.mark.parametrize("caught", [True, False])
def test_how_it_ends(caught, world):
    """The robot drives straight at a resting ball, or away from it."""
    env = GymWorld(world, 3)
    env.reset(options={"start": (0.0 if caught else np.pi, 0.0)})
    for _ in range(world.time_limit_steps):
        _, reward, terminated, truncated, info = env.step(1)
        if terminated:
            break
    assert (terminated, truncated, info["is_success"]) == (True, False, caught)
    assert reward == (world.catch_reward if caught else world.miss_reward)
    with pytest.raises(ResetNeeded, match="it has ended"):
        env.step(1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, r"seed=-1: must be a whole number in \[0, "),
        ({"seed": 2**63}, "seed="),
        ({"seed": 0.5}, "seed="),
        ({"options": {"episode": 2**33}}, "episode="),
        ({"options": {"episode": True}}, "episode="),
        ({"seed": 7, "options": {"episode": -1}}, "episode="),
        ({"options": {"start": (1.0,)}}, "start="),
        ({"options": {"start": (1.0, np.inf)}}, "start="),
        ({"options": {"start": 3}}, "start="),
        ({"options": {"starts": (0, 0)}}, "options=starts: must be episode or start"),
    ],
)
def test_what_reset_refuses(arguments, message, env):
    """The refusal is one line and changes nothing in the run."""
    env.reset(seed=3)
    with pytest.raises(OutOfRange, match=message) as refusal:
        env.reset(**arguments)
    assert "\n" not in str(refusal.value)
    first = env.reset()[0]
    env.reset(seed=3)
    assert env.reset()[0] == first


@pytest.mark.parametrize("action", [-1, CANDIDATES, 0.5, None])
def test_there_is_no_such_action(action, env):
    env.reset()
    with pytest.raises(OutOfRange, match=r"action=.*: must be a whole number in \[0, 21\)"):
        env.step(action)


def test_no_step_before_a_reset(env):
    with pytest.raises(ResetNeeded, match="no episode has begun"):
        env.step(0)


def test_a_single_candidate_is_too_few(world):
    with pytest.raises(OutOfRange, match="candidates=1"):
        GymWorld(world, 1)


# -- registered tasks -----------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["fnnq_torchrl, gymnasium", "gymnasium, fnnq_torchrl"])
def test_importing_the_package_registers_the_tasks_without_torch(order):
    script = f"import {order}, sys; print(*gymnasium.registry, 'torch' in sys.modules)"
    *names, torch_is_loaded = subprocess.check_output(
        [sys.executable, "-c", script], text=True
    ).split()
    assert {*registration.TASKS} <= {*names}
    assert torch_is_loaded == "False"


def test_the_package_alone_does_not_load_gymnasium():
    script = "import sys, fnnq_torchrl; sys.exit('gymnasium' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


@pytest.mark.parametrize("name", registration.TASKS)
def test_every_task_is_registered_and_checked(name):
    made = gymnasium.make(name, render_mode="rgb_array")
    check_env(made.unwrapped, skip_render_check=True)
    made.reset(seed=0)
    picture = made.render()
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    made.step(0)
    assert (made.render() != picture).any()


def test_no_other_picture_than_that_is_offered(world):
    with pytest.raises(OutOfRange, match="render_mode=human: must be rgb_array or None"):
        GymWorld(world, CANDIDATES, render_mode="human")
    assert GymWorld(world, CANDIDATES).render() is None


def test_the_members_of_a_vector_are_the_single_worlds(world):
    """Each with its own seed, over the end of several situations."""
    short = replace(world, circle_radius_m=0.4, time_limit_steps=12)
    many = GymWorlds(3, short, CANDIDATES)
    single = [GymWorld(short, CANDIDATES) for _ in range(3)]
    seen, _ = many.reset(seed=5)
    assert len({*seen[:, 0].tolist()}) == 3
    for member, env in enumerate(single):
        assert env.reset(seed=5 + member)[0] == seen[member]
    over = [False] * 3
    choose = np.random.default_rng(0)
    for _ in range(40):
        actions = choose.integers(CANDIDATES, size=3)
        seen, rewards, ends, cuts, info = many.step(actions)
        for member, env in enumerate(single):
            if over[member]:
                wanted = (env.reset()[0], 0.0, False, False, {"is_success": False})
            else:
                wanted = env.step(actions[member])
            over[member] = wanted[2]
            assert wanted[0] == pytest.approx(seen[member], abs=1e-6)
            assert wanted[1:4] == (rewards[member], ends[member], cuts[member])
            assert wanted[4]["is_success"] == info["is_success"][member]


def test_gymnasium_makes_vectors_too():
    many = gymnasium.make_vec("fnnq/Follow-v0", num_envs=4)
    seen, _ = many.reset(seed=1)
    assert seen.shape == (4, 1)
    assert len({*seen[:, 0].tolist()}) == 4
    assert isinstance(many.unwrapped, GymWorlds)


@pytest.fixture
def doubles():
    """Make float64 torch's default dtype, as some users' programs do."""
    before = torch.get_default_dtype()
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(before)


def test_the_default_dtype_does_not_reach_the_worlds(world, doubles):
    for env, action in ((GymWorld(world, 21), 3), (GymWorlds(2, world, 21), np.array([3, 4]))):
        seen, _ = env.reset(seed=np.int64(5))
        again, _ = env.reset(seed=5)
        assert np.array_equal(seen, again)
        stepped = env.step(action)[0]
        for each in (seen, stepped):
            assert each.dtype == np.float32
            assert env.observation_space.contains(each)
    env = GymWorld(world, 21)
    seen, _ = env.reset(options={"start": [0.5] * len(world.start_values)})
    assert env.observation_space.contains(seen)
