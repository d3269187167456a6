"""The robot's worlds in which the caller moves the objects and changes the robot."""

from dataclasses import replace

import pytest
import torch
from tensordict import TensorDictBase
from torch import Tensor

from envs.core.pure import PureEnv
from envs.core.world import WorldConfig
from envs.robot.played import PLAYED
from envs.worlds import make_world
from fnnq_torchrl.launch.composition import load_config
from tests.envs.robot.scenes import full_scene

KINDS = [*PLAYED, "full"]


def world_of(kind: str) -> WorldConfig:
    if kind == "full":
        return full_scene(load_config("task=follow_obstacles").env)
    return load_config(f"task={kind.removesuffix('_ball')}").env


def drive(env: PureEnv, state: TensorDictBase, steps: int = 6) -> list[TensorDictBase]:
    """Return the states after each of some steps with changing Δv."""
    states = []
    for number in range(steps):
        action = torch.full((*env.batch_size, 1), (-1) ** number * number / steps, dtype=env.dtype)
        state = env.step(state.set("action", action))["next"]
        states.append(state)
    return states


def pair(world: WorldConfig, other: WorldConfig | None = None) -> tuple[PureEnv, PureEnv]:
    """Return a played world, and the world itself or another one, for three runs."""
    settings = {"seed": 5, "dtype": torch.float64}
    return PLAYED[world.kind](world, [3], **settings), make_world(other or world, [3], **settings)


def same(one: Tensor, other: Tensor) -> bool:
    return torch.equal(one, other)


@pytest.mark.parametrize("kind", KINDS)
def test_untouched_it_is_the_world_itself(kind: str) -> None:
    played, world = pair(world_of(kind))
    ours, theirs = played.reset(), world.reset()
    for one, other in zip(
        [ours, *drive(played, ours)], [theirs, *drive(world, theirs)], strict=True
    ):
        assert all(same(one[key], value) for key, value in other.exclude("action", "next").items())


@pytest.mark.parametrize("kind", KINDS)
def test_a_step_changes_none_of_what_the_caller_writes(kind: str) -> None:
    played, _ = pair(world_of(kind))
    state = played.reset()
    if kind != "wander":
        state["held"] += 1.0
        state["ball_x_m"] = state["ball_x_m"] + 0.3
    state["speed_mps"] += 0.1
    state[played.noise] *= 2
    keys = [*(key for key in played.shared if "angle" not in key), "speed_mps", played.noise]
    [after] = drive(played, state, 1)
    assert all(same(after[key], state[key]) for key in keys)


@pytest.mark.parametrize("kind", ["follow_ball", "full"])
def test_only_held_balls_stay(kind: str) -> None:
    played, world = pair(world_of(kind))
    ours, theirs = played.reset(), world.reset()
    ours["held"][1] = 1
    [one], [other] = drive(played, ours, 1), drive(world, theirs, 1)
    start = ours["ball_x_m"]
    assert same(one["ball_x_m"][1], start[1])
    assert (one["ball_x_m"][[0, 2]] != start[[0, 2]]).any(-1).all()
    if kind == "full":
        assert same(one["ball_x_m"][[0, 2]], other["ball_x_m"][[0, 2]])


def test_a_moved_obstacle_is_in_the_robots_way() -> None:
    played, _ = pair(world_of("wander"))
    state = played.reset()
    state["disc_x_m"][1, 0], state["disc_y_m"][1, 0] = 0.46, 0.0
    state["disc_radius_m"][:] = 0.2
    state["noise"][:] = 0
    [after] = drive(played, state, 1)
    assert after["terminated"].flatten().tolist() == [False, True, False]
    assert after["sonar_m"][1, 3] == pytest.approx(0.46 - 0.2 - 0.17, abs=0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_the_robots_speed_is_the_states(kind: str) -> None:
    world = world_of(kind)
    faster = (
        replace(world, speed_mps=0.45)
        if kind == "follow_ball"
        else replace(world, robot=replace(world.robot, speed_mps=0.45))
    )
    played, other = pair(world, faster)
    state = played.reset()
    state["speed_mps"][:] = 0.45
    [one], [theirs] = drive(played, state, 1), drive(other, other.reset(), 1)
    assert all(same(one[key], theirs[key]) for key in ("x_m", "y_m", "heading_rad"))


def test_noise_is_a_factor_on_all_errors() -> None:
    world = world_of("follow_obstacles")
    sonar, vision = world.sensors.sonar, world.sensors.vision
    triple = replace(
        world.sensors,
        sonar=replace(sonar, noise_m=3 * sonar.noise_m, noise_share=3 * sonar.noise_share),
        vision=replace(
            vision,
            bearing_noise_rad=3 * vision.bearing_noise_rad,
            distance_noise_share=3 * vision.distance_noise_share,
        ),
    )
    played, other = pair(world, replace(world, sensors=triple))
    state = played.reset()
    state["noise"][:] = 3
    [one], [theirs] = drive(played, state, 1), drive(other, other.reset(), 1)
    for key in ("sonar_m", "bearing", "ball_distance_m"):
        torch.testing.assert_close(one[key], theirs[key])


def test_the_bearings_noise_is_the_states() -> None:
    world = world_of("follow_ball")
    played, other = pair(world, replace(world, bearing_noise_rad=0.2))
    state = played.reset()
    state["bearing_noise_rad"][:] = 0.2
    [one], [theirs] = drive(played, state, 1), drive(other, other.reset(), 1)
    assert same(one["bearing"], theirs["bearing"])
