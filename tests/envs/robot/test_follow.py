"""The follow-the-ball world equals its twin, works with TorchRL, and keeps runs independent."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import (
    Compose,
    DoubleToFloat,
    InitTracker,
    RewardSum,
    SerialEnv,
    StepCounter,
    TransformedEnv,
    check_env_specs,
)

from envs.robot.follow import FollowBall
from envs.robot.schemas import FollowBallConfig
from envs.worlds import make_world
from fnnq_torchrl.engine.lanes import LANES
from tests.oracles.follow_ball import FollowBallTwin
from tests.programs import in_lanes

Policy = Callable[[TensorDictBase], TensorDictBase]

STATE = "x_m", "y_m", "heading_rad", "ball_angle_rad", "ball_speed_radps"
SEEN = "bearing", "chance"
WHEN = "seed", "episode", "step"

BATCH_SIZES = (), (3,), (2, 3)
DTYPES = torch.float32, torch.float64
gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU")
DEVICES = None, "cpu", pytest.param("cuda", marks=gpu)

# Collectors are imported late, because TorchRL warns about its own classes when it loads them.
loads_collectors = pytest.mark.filterwarnings(
    r"ignore:Creating \w+ which inherits from WeightUpdaterBase is deprecated:DeprecationWarning"
)
# Inductor loads a part of torch that still uses deprecated functions of torch.
compiles = pytest.mark.filterwarnings(r"ignore:`torch\.jit\.\w+` is deprecated:DeprecationWarning")


def play(env: FollowBall, policy: Policy, steps: int) -> TensorDictBase:
    """Return the history of all runs, ``[*batch, steps]``, with a reset after each end."""
    return env.rollout(steps, policy, break_when_any_done=False)


def steer(env: FollowBall, *steering: float) -> TensorDictBase:
    """Return the first step of new situations, with a given Δv for every run."""
    action = torch.tensor(steering, dtype=env.dtype).view(*env.batch_size, 1)
    return env.step(env.reset().set("action", action))["next"]


# -- the world ------------------------------------------------------------------------------------


ON_ONE_SIDE = {"start_side": "right", "other_view_rad": 0.2, "switch_side_after": 1}


@pytest.mark.parametrize("policy", ["wander", "follow"])
@pytest.mark.parametrize("situations", [None, [(0.8, 0.1), (-3.0, -0.4), (0.0, 0.0)]])
@pytest.mark.parametrize("side", ["both sides", "one side"])
def test_it_equals_its_twin(policy, situations, side, world, one_side, request):
    """Three runs, with seeds of more than one word, play several situations."""
    if side == "one side":
        world = replace(one_side, **ON_ONE_SIDE)
    seeds = torch.tensor([0, 2**32 - 1, 2**40 + 7])
    fixed = None if situations is None else torch.tensor(situations, dtype=torch.float64)
    env = make_world(world, [3], situations=fixed, seed=seeds, dtype=torch.float64)
    history = play(env, request.getfixturevalue(policy), 250)
    assert (history["episode"][:, -1] >= 2).all()
    for run, seed in enumerate(seeds.tolist()):
        told = twin_history(world, seed, history["action"][run], situations and situations[run])
        for key, values in told.items():
            torch.testing.assert_close(history[run][key], values, rtol=0, atol=1e-10)


def twin_history(
    world: FollowBallConfig, seed: int, actions: Tensor, situation
) -> dict[str, Tensor]:
    """Return the twin's history for a run's actions ``[steps, 1]``, with a rollout's keys."""
    twin = FollowBallTwin(world, seed, 0, situation)
    rows = []
    for action in actions.flatten().tolist():
        row = {key: getattr(twin, key) for key in (*STATE, *SEEN, *WHEN)}
        reward, end = twin.move(action)
        row |= {("next", key): getattr(twin, key) for key in (*STATE, *SEEN, *WHEN)}
        rows.append(row | {("next", "reward"): reward, ("next", "terminated"): end})
        if end:
            twin = FollowBallTwin(world, seed, twin.episode + 1, situation)

    def column(key) -> Tensor:
        values = torch.tensor([row[key] for row in rows])
        dtype = torch.float64 if isinstance(rows[0][key], float) else values.dtype
        return torch.tensor([[row[key]] for row in rows], dtype=dtype)

    return {key: column(key) for key in rows[0]}


def test_how_a_step_can_end(world):
    """The first ball is caught, at the last moment; the second is missed; the third runs on."""
    near = replace(world, circle_radius_m=0.22, time_limit_steps=1)
    ahead_and_behind = torch.tensor([[0, 0], [math.pi, 0]])
    after = steer(FollowBall(near, [2], situations=ahead_and_behind, seed=0), 0, 0)
    assert after["reward"].tolist() == [[1], [-0.5]]
    assert after["terminated"].tolist() == after["done"].tolist() == [[True], [True]]
    assert after["success"].tolist() == [[True], [False]]
    assert not after["truncated"].any()
    after = steer(FollowBall(world, seed=0), 0)
    assert [after[key].item() for key in ("reward", "success", "terminated", "done")] == [0] * 4


def test_a_situation_starts_at_the_origin_with_the_balls_own_start(world):
    situations = torch.tensor([[0.8, 0.1], [-0.8, -0.1]])
    start = FollowBall(world, [2], situations=situations, seed=0).reset()
    assert torch.cat([start["x_m"], start["y_m"], start["heading_rad"]]).eq(0).all()
    assert torch.cat([start["ball_angle_rad"], start["ball_speed_radps"]], -1).equal(situations)
    assert start["step"].eq(0).all()
    # The robot stands at the origin and sees the ball at the angle φ₀, up to the noise.
    torch.testing.assert_close(start["bearing"][:, 0], situations[:, 0], rtol=0, atol=0.06)


SIDES = {"left": 1, "right": -1}


@given(
    side=st.sampled_from([*SIDES]),
    switch_after=st.integers(0, 5),
    other_view_rad=st.floats(0, 2),
    start_angle_rad=st.floats(0, 3),
)
def test_situations_on_one_side_are_those_on_both_mirrored(
    side, switch_after, other_view_rad, start_angle_rad, one_side
):
    on_one = replace(
        one_side,
        start_angle_rad=start_angle_rad,
        field_of_view_rad=1.5,
        start_side=side,
        switch_side_after=switch_after,
        other_view_rad=other_view_rad,
    )
    seed, episode = torch.arange(3).repeat(6), torch.arange(6).repeat_interleave(3)
    drawn, start = (
        make_world(each, [18], dtype=torch.float64, seed=0).start(
            seed.unsqueeze(-1), episode.unsqueeze(-1)
        )
        for each in (on_one.tested, on_one)
    )
    sign = torch.full((18, 1), float(SIDES[side]))
    if switch_after:
        sign[episode >= switch_after] *= -1
    assert start["ball_angle_rad"].equal(sign * drawn["ball_angle_rad"].abs())
    assert start["ball_speed_radps"].equal(drawn["ball_speed_radps"])
    assert (sign * start["bearing"]).min() >= -other_view_rad
    assert (sign * start["bearing"]).max() <= 1.5


def test_in_the_test_nothing_is_mirrored_or_hidden(world, one_side, wander):
    on_one = replace(one_side, **ON_ONE_SIDE)
    assert on_one.tested == world
    whole, hidden = (play(make_world(each, [64], seed=0), wander, 60) for each in (world, on_one))
    assert whole["bearing"].min() == -1
    first = hidden["episode"] < 1
    assert hidden["bearing"][first].max() == torch.tensor(0.2)
    assert hidden["bearing"][first].min() == -1


@pytest.mark.parametrize("situations", [(0.4, -0.15), [(0.4, -0.15)], [[(0.4, -0.15)] * 3] * 2])
def test_fixed_situations_broadcast_and_come_back_every_episode(situations, world):
    given = torch.tensor(situations)
    env = FollowBall(world, (2, 3), situations=given, seed=0)
    for _ in range(3):
        start = env.reset()
        assert start["ball_angle_rad"].eq(torch.tensor(0.4)).all()
        assert start["ball_speed_radps"].eq(torch.tensor(-0.15)).all()
        for tensor in (given, *start.values()):  # changing these tensors doesn't change the world
            tensor.zero_()


def test_the_noise_is_new_at_every_step_and_as_large_as_said(world):
    """Two robots at the same place differ only in the noise."""
    situations = torch.tensor([0.1, 0.0], dtype=torch.float64)
    env = FollowBall(world, [4096], situations=situations, dtype=torch.float64, seed=0)
    start = env.reset()
    after = env.step(start.set("action", torch.zeros_like(start["bearing"])))["next"]
    for seen in (start["bearing"], after["bearing"]):
        assert float(seen.std()) == pytest.approx(world.bearing_noise_rad, rel=0.05)
    assert float(start["bearing"].mean()) == pytest.approx(0.1, abs=0.001)
    assert torch.corrcoef(torch.stack([start["bearing"], after["bearing"]])[..., 0])[0, 1] < 0.05


# -- the fewest steps -----------------------------------------------------------------------------


def test_no_situation_ends_in_fewer_steps(world):
    """Even a robot that sees without noise and drives straight at the ball needs that many."""
    env = FollowBall(replace(world, bearing_noise_rad=0.0), [4096], seed=0)
    state = env.reset()
    for _ in range(env.world.fewest_steps - 1):
        action = (-5 * state["bearing"]).clamp(-1, 1)
        state = env.step(state.set("action", action))["next"]
        assert not state["done"].any()


@pytest.mark.parametrize(
    ("radius_m", "catch_m", "stride_m", "fewest"),
    [
        (1.5, 0.2, 0.03, 43),
        (1.0, 0.25, 0.125, 6),  # six strides end exactly at the catch distance, so seven are needed
        (1.0, 0.25, 0.3, 2),
        (0.3, 0.2, 0.25, 1),
        (0.2, 0.3, 0.05, 1),  # within the catch distance from the start
        (5.0, 0.2, 0.01, 120),  # too far away for the time
    ],
)
def test_the_fewest_steps_are_almost_reached(radius_m, catch_m, stride_m, fewest, world, straight):
    """The robot drives straight at a resting ball."""
    ahead = replace(
        world,
        circle_radius_m=radius_m,
        catch_distance_m=catch_m,
        speed_mps=stride_m,
        time_step_s=1.0,
    )
    env = FollowBall(ahead, situations=torch.zeros(2), dtype=torch.float64, seed=0)
    assert env.world.fewest_steps == fewest
    steps = len(env.rollout(ahead.time_limit_steps, straight))
    assert fewest <= steps <= fewest + 1


# -- with TorchRL ---------------------------------------------------------------------------------


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("dtype", DTYPES, ids=str)
@pytest.mark.parametrize("batch_size", BATCH_SIZES, ids=str)
def test_specs(batch_size, dtype, device, world):
    env = FollowBall(world, batch_size, dtype=dtype, device=device, seed=0)
    check_env_specs(env, break_when_any_done="both")
    state = env.reset()
    assert state.device == env.device
    assert {key: state[key].dtype for key in (*STATE, *SEEN)} == dict.fromkeys(STATE + SEEN, dtype)


@pytest.mark.parametrize("batch_size", BATCH_SIZES, ids=str)
def test_all_that_it_ever_gives_lies_in_its_specs(batch_size, world, follow):
    env = FollowBall(world, batch_size, seed=0)
    history = play(env, follow, 150)
    assert history.shape == (*batch_size, 150)
    for state in history.unbind(-1):
        assert env.observation_spec.contains(state.select(*env.observation_spec.keys()))
        assert env.action_spec.contains(state["action"])
        assert env.reward_spec.contains(state["next", "reward"])
    assert set(history["next", "reward"].unique().tolist()) <= {-0.5, 0.0, 1.0}
    assert history["next", "done"].equal(history["next", "terminated"])
    assert history["next", "done"].equal(history["next", "reward"] != 0)


@pytest.mark.parametrize("batch_size", BATCH_SIZES, ids=str)
def test_a_step_leaves_its_input_alone(batch_size, world):
    env = FollowBall(world, batch_size, seed=0)
    state = env.rand_action(env.reset())
    before = state.clone()
    after = env.step(state)
    assert (after.exclude("next") == before).all()


@pytest.mark.parametrize("batch_size", BATCH_SIZES, ids=str)
def test_counting_transforms(batch_size, world, follow):
    transforms = Compose(InitTracker(), StepCounter(), RewardSum())
    env = TransformedEnv(FollowBall(world, batch_size, seed=0), transforms)
    check_env_specs(env)
    history = play(env, follow, 150)
    assert history["step_count"].equal(history["step"])
    assert history["is_init"].equal(history["step"] == 0)
    done = history["next", "done"]
    assert done.any()
    assert history["next", "episode_reward"][done].equal(history["next", "reward"][done])


def test_double_to_float(world, follow):
    """A policy in float32 on a world in float64."""

    def env():
        return TransformedEnv(FollowBall(world, [3], dtype=torch.float64, seed=0), DoubleToFloat())

    check_env_specs(env())
    history = play(env(), follow, 5)
    assert {history[key].dtype for key in (*SEEN, "action", ("next", "reward"))} == {torch.float32}
    exact = play(FollowBall(world, [3], dtype=torch.float64, seed=0), follow, 5)
    torch.testing.assert_close(history["bearing"].double(), exact["bearing"], atol=1e-6, rtol=0)


def test_a_time_limit_by_transform_is_a_truncation(world, wander):
    """The world's own time limit is a termination instead."""
    env = TransformedEnv(FollowBall(world, [3], seed=0), StepCounter(max_steps=10))
    history = play(env, wander, 10)["next"]
    assert history["truncated"][:, -1].all()
    assert history["done"][:, -1].all()
    assert not history["terminated"].any()


def test_a_stack_of_envs(world, wander):
    stack = SerialEnv(2, partial(FollowBall, world, [3]))
    check_env_specs(stack)
    next_seed = stack.set_seed(5, static_seed=True)
    history = play(stack, wander, 20)
    assert next_seed == 5
    assert (history[0] == history[1]).all()
    assert (history[0] == play(FollowBall(world, [3], seed=5), wander, 20)).all()


@loads_collectors
def test_a_collector_collects_what_a_rollout_shows(world, follow):
    from torchrl.collectors import Collector

    def env():
        # Without an InitTracker, TorchRL warns that its next version will add one.
        return TransformedEnv(FollowBall(world, [4], seed=3), Compose(InitTracker(), RewardSum()))

    collector = Collector(env(), follow, frames_per_batch=4 * 80, total_frames=2 * 4 * 80)
    collected = torch.cat(list(collector), -1)
    collector.shutdown()
    assert collected["episode"].max() >= 2
    assert (collected.exclude("collector") == play(env(), follow, 160)).all()


@loads_collectors
def test_a_collector_takes_the_env_alone(world):
    from torchrl.collectors import Collector

    collector = Collector(FollowBall(world, seed=0), frames_per_batch=50, total_frames=100)
    assert [batch.shape for batch in collector] == [(50,), (50,)]
    collector.shutdown()


def test_step_and_restart_trace_whole(world, follow):
    """A compiled loop needs a graph without breaks, so without branches on data."""
    env = FollowBall(world, [LANES], seed=0)
    go_on = torch.compile(
        lambda state: env.restart(env.step(state)["next"]), fullgraph=True, backend="aot_eager"
    )
    history = play(env, follow, 80)
    assert history["next", "done"].any()
    for step in range(79):
        state = history[:, step].exclude("next", "done", "terminated")
        torch.testing.assert_close(
            go_on(state).to_dict(), history[:, step + 1].select(*STATE, *SEEN, *WHEN).to_dict()
        )


# -- runs are independent -------------------------------------------------------------------------


def test_set_seed_gives_the_runs_the_seeds_that_follow(world, follow):
    env = FollowBall(world, [4], seed=9)
    other = play(env, follow, 80)
    env.set_seed(3)
    history = play(env, follow, 80)
    assert history["seed"][:, 0, 0].tolist() == [3, 4, 5, 6]
    assert (history["ball_angle_rad"][:, 0] != other["ball_angle_rad"][:, 0]).all()
    env.set_seed(3)
    assert (play(env, follow, 80) == history).all()


@pytest.mark.parametrize("dtype", DTYPES, ids=str)
def test_a_run_alone_equals_the_same_run_in_any_batch(dtype, world, follow):
    """The bits are equal in full lanes, whichever other runs are reset, and whenever."""
    seeds = in_lanes(torch.tensor([77]))
    alone = play(FollowBall(world, [LANES], seed=seeds, dtype=dtype), follow, 200)
    assert alone["episode"].max() >= 3
    for count, lane in ((40, 17), (96, 95)):
        seeds = 1000 + torch.arange(count)
        seeds[lane] = 77
        seeds = in_lanes(seeds)
        batch = play(FollowBall(world, [len(seeds)], seed=seeds, dtype=dtype), follow, 200)
        assert (batch[lane] == alone[0]).all()
        assert not (batch["next", "done"] == batch["next", "done"][lane]).all()


@pytest.mark.parametrize("shape", [(2, 32), (32, 2), (4, 4, 4)])
def test_a_run_doesnt_depend_on_the_batchs_shape(shape, world, follow):
    flat = play(FollowBall(world, [64], seed=0), follow, 100)
    history = play(FollowBall(world, shape, seed=0), follow, 100)
    assert (history.flatten(0, len(shape) - 1) == flat).all()


def test_situations_start_the_same_whatever_happened_before(world, follow, wander):
    """The n-th start of a seed is the same after catches or misses, and by reset or `start`."""
    env = FollowBall(world, [LANES], seed=0)
    starts: dict[tuple[int, int], TensorDictBase] = {}
    for policy in (follow, wander):
        env.set_seed(0)
        history = play(env, policy, 150).select(*STATE, *SEEN, *WHEN)
        for start in history[history["step"][..., 0] == 0].unbind(0):
            when = int(start["seed"]), int(start["episode"])
            assert (starts.setdefault(when, start) == start).all()
    for episode in range(2):
        number = torch.full((LANES, 1), episode)
        for start in env.start(torch.arange(LANES).unsqueeze(-1), number).unbind(0):
            assert (starts[int(start["seed"]), episode] == start).all()


def test_every_situation_is_another_one(world):
    env = FollowBall(world, [100], seed=0)
    angle_rad = torch.cat([env.reset()["ball_angle_rad"] for _ in range(5)])
    assert len(angle_rad.unique()) == 500


def test_no_global_random_numbers(world, follow):
    """The world neither draws from torch's global generator nor seeds it."""

    def history() -> TensorDictBase:
        env = FollowBall(world, [3], seed=7)
        env.set_seed(5)
        return play(env, follow, 80)

    with torch.random.fork_rng():
        torch.manual_seed(1)
        before = torch.get_rng_state()
        one = history()
        assert torch.get_rng_state().equal(before)
        torch.manual_seed(2)
        assert (history() == one).all()


def test_unseeded_worlds_differ_and_a_seeded_torch_repeats_them(world):
    def seeds() -> list[int]:
        stack = SerialEnv(3, partial(FollowBall, world, [2]))
        drawn: list[int] = stack.reset()["seed"].flatten().tolist()
        return drawn

    with torch.random.fork_rng():
        torch.manual_seed(1)
        first, second = seeds(), seeds()
        assert len({*first, *second}) == 12
        torch.manual_seed(1)
        assert seeds() == first


def test_both_precisions_draw_the_same_world(world):
    single, double = (FollowBall(world, [64], dtype=dtype, seed=0).reset() for dtype in DTYPES)
    assert single["chance"].double().equal(double["chance"])
    for key in ("ball_angle_rad", "ball_speed_radps", "bearing"):
        torch.testing.assert_close(single[key].double(), double[key], rtol=1e-6, atol=1e-6)


@gpu
def test_a_gpu_shows_the_same_world(world, follow):
    cpu, cuda = (
        play(FollowBall(world, [LANES], dtype=torch.float64, device=device, seed=0), follow, 100)
        for device in ("cpu", "cuda")
    )
    for key in (*STATE, *SEEN, *WHEN):
        torch.testing.assert_close(cuda[key].cpu(), cpu[key], rtol=0, atol=1e-9)
