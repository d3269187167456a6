"""Worlds with obstacles and sensors: layouts, driving, sensor readings and ends."""

from dataclasses import replace
from math import pi

import pytest
import torch
from torchrl.envs import check_env_specs

from envs.core.contract import check_world
from envs.robot.arena import Arena
from envs.robot.layout import NOWHERE_M
from envs.robot.scene import SceneConfig
from envs.worlds import make_world
from fnnq_torchrl.engine.lanes import LANES
from tests.compositions import config_of
from tests.envs.robot.scenes import check_state, full_scene, objects
from tests.oracles import rays


@pytest.fixture(scope="module")
def follow() -> SceneConfig:
    return config_of("task=follow_obstacles").env


@pytest.fixture(scope="module")
def wander() -> SceneConfig:
    return config_of("task=wander").env


@pytest.fixture(scope="module")
def full(follow: SceneConfig) -> SceneConfig:
    return full_scene(follow)


def driven(env: Arena, *steering: float):
    """Return the state after one step with each of these Δv, in turn."""
    state = env.reset()
    for number in steering:
        action = torch.full((*env.batch_size, 1), number, dtype=env.dtype)
        state = env.step(state.set("action", action))["next"]
    return state


@pytest.mark.parametrize("batch_size", [(), (2, 3)])
@pytest.mark.parametrize("name", ["follow", "wander", "full"])
def test_it_is_an_env(name, batch_size, request):
    env = make_world(request.getfixturevalue(name), batch_size, dtype=torch.float64)
    check_env_specs(env, break_when_any_done=False)


@pytest.mark.parametrize("name", ["follow", "wander", "full"])
def test_it_keeps_the_contract(name, request):
    check_world(make_world(request.getfixturevalue(name), [2]))


# -- layouts --------------------------------------------------------------------------------------


def test_nothing_overlaps_at_the_start(full):
    env = make_world(full, [500], dtype=torch.float64)
    state = env.reset()
    boxes, discs = objects(env, state)
    reach = torch.hypot(boxes.half_width_m, boxes.half_height_m)
    x = torch.cat([discs.x_m, boxes.x_m, torch.zeros(1, 500)])
    y = torch.cat([discs.y_m, boxes.y_m, torch.zeros(1, 500)])
    radius = torch.cat([discs.radius_m, reach, torch.full((1, 500), 0.25)])
    ball_x, ball_y = state["ball_x_m"].T, state["ball_y_m"].T
    for one in range(len(x)):
        for other in range(one):
            if {one, other} == {0, 4}:  # both fixed
                continue
            gap = torch.hypot(x[one] - x[other], y[one] - y[other]) - radius[one] - radius[other]
            here = (x[one] < NOWHERE_M) & (x[other] < NOWHERE_M)
            assert (gap[here] > 0.05).all()
    drawn = [1, 2, 3, 5, 6]
    for ball, its in enumerate((0.1, 0.2, 0.1)):
        gap = torch.hypot(x[drawn] - ball_x[ball], y[drawn] - ball_y[ball]) - radius[drawn] - its
        assert (gap > 0.05).all()
    assert (x[drawn] < NOWHERE_M).double().mean() > 0.98


def test_every_situation_of_every_run_has_a_layout_of_its_own(follow):
    env = make_world(follow, [200], seed=0)
    first, second = env.reset(), env.reset()
    places = torch.cat([first["disc_x_m"], second["disc_x_m"]]).flatten()
    assert len(places.unique()) > 0.98 * len(places)
    assert 0.4 < first["ball_path"].mean() < 0.6
    again = make_world(follow, [200], seed=0).reset()
    assert all(again[key].equal(first[key]) for key in again.keys())  # noqa: SIM118


def test_a_run_is_the_same_alone_and_in_a_batch(full):
    """The batches are multiples of LANES: the bits are equal only in full vectors."""
    seed = torch.arange(3 * LANES)
    actions = torch.rand(5, 3 * LANES, 1) * 2 - 1
    histories = []
    for part in (slice(None), slice(LANES, 2 * LANES)):
        env = make_world(full, [len(seed[part])], seed=seed[part])
        state = env.reset()
        for action in actions:
            state = env.step(state.set("action", action[part]))["next"]
        histories.append(state)
    for key, value in histories[1].items():
        assert histories[0][key][LANES : 2 * LANES].equal(value), key


# -- driving --------------------------------------------------------------------------------------


def test_random_driving_gives_no_overlap_and_no_impossible_reading(full):
    env = make_world(full, [64], seed=7)
    state = env.reset()
    for _ in range(40):
        state = env.restart(env.step(env.rand_action(state))["next"])
        check_state(env, state)


OPEN = {"obstacles": [], "field_size_m": None}
POST = {"shape": "disc", "number": 1, "centre_m": [0.6, 0], "radius_m": 0.3}


def test_a_collision_ends_the_situation_or_stops_the_robot(wander, full):
    blocked = replace(wander, obstacles=[POST])
    after = driven(make_world(blocked, [1]), 0, 0)
    assert (after["reward"], after["terminated"], after["success"]) == (-1, True, False)
    stops = replace(full, obstacles=[POST])
    env = make_world(stops, [1])
    after = driven(env, 0, 0, 1, 1)
    assert after["x_m"].item() == pytest.approx(0.03)
    assert after["heading_rad"].item() == pytest.approx(-2 * 0.3 * 0.2 / 0.321)
    assert not after["terminated"]


def test_what_wandering_is_worth(wander):
    env = make_world(replace(wander, time_limit_steps=2, **OPEN), [1])
    state = driven(env, 0.5)
    assert state["reward"].item() == pytest.approx(0.025)
    assert not state["done"]
    state = driven(env, 0.5, -1)
    assert state["reward"].item() == pytest.approx(0.02)
    assert (state["truncated"], state["terminated"], state["success"]) == (True, False, True)


def ball(x: float, y: float, kind: str = "ball") -> dict:
    return {"kind": kind, "radius_m": 0.1, "paths": [{"path": "still", "start_m": [x, y]}]}


def test_how_a_hunt_ends(follow):
    near = replace(follow, balls=[ball(0.22, 0)], **OPEN)
    after = driven(make_world(near, [1]), 0)
    assert (after["reward"], after["terminated"], after["success"]) == (1, True, True)
    far = replace(follow, balls=[ball(2, 0)], time_limit_steps=1, **OPEN)
    after = driven(make_world(far, [1]), 0)
    assert (after["reward"], after["terminated"], after["success"]) == (-0.5, True, False)
    wrong = replace(follow, balls=[ball(0.22, 0, "goal"), ball(3, 3)], **OPEN)
    assert driven(make_world(wrong, [1]), 0)["reward"] == 0
    hit = replace(follow, balls=[ball(-2, 0)], obstacles=[{**POST, "centre_m": [0.57, 0]}])
    after = driven(make_world(hit, [1]), 0)
    assert (after["reward"], after["terminated"], after["success"]) == (-1, True, False)


# -- what the robot perceives ---------------------------------------------------------------------


def exact(config: SceneConfig, **changes) -> SceneConfig:
    """Return the configuration with exact sensors."""
    sonar, vision = config.sensors.sonar, config.sensors.vision
    sonar = replace(sonar, noise_m=0, noise_share=0)
    vision = replace(vision, bearing_noise_rad=0, distance_noise_share=0, **changes)
    return replace(config, sensors=replace(config.sensors, sonar=sonar, vision=vision))


def test_the_ring_is_read_as_rays_read_it(follow):
    """All sonars of a robot that has turned and moved agree with the oracle's rays."""
    env = make_world(exact(follow), [20], dtype=torch.float64)
    state = driven(env, 1, 1, 0.3, -0.2, 0)
    _, discs = None, torch.stack([state[f"disc_{key}"] for key in ("x_m", "y_m", "radius_m")], -1)
    for run in range(20):
        pose = [state[key][run].item() for key in ("x_m", "y_m", "heading_rad")]
        for sonar, (x, y, turn) in enumerate(follow.sensors.sonar.ring):
            heading = torch.tensor(pose[2])
            spot = (
                pose[0] + float(x * heading.cos() - y * heading.sin()),
                pose[1] + float(x * heading.sin() + y * heading.cos()),
            )
            told = rays.reading(
                spot,
                pose[2] + turn * pi / 180,
                pi / 12,
                [rays.Disc(*disc) for disc in discs[run].tolist()],
                [],
                rays.field(6, 6),
                rays=50,
            )
            assert state["sonar_m"][run, sonar].item() == pytest.approx(min(told, 5), abs=1e-5)
    groups = follow.sensors.sonar.groups
    for name, members in groups.items():
        assert state[name][:, 0].equal(state["sonar_m"][:, members].amin(1))


def test_sonars_see_balls_only_if_they_are_to(follow):
    scene = replace(exact(follow), balls=[ball(1.0, 0)], **OPEN)
    assert make_world(scene, [1]).reset()["sonar_front_m"] == 5
    sonar = replace(scene.sensors.sonar, sees_balls=True)
    sees = replace(scene, sensors=replace(scene.sensors, sonar=sonar))
    front = make_world(sees, [1]).reset()["sonar_front_m"].item()
    assert 0.73 < front < 0.76  # the nearest point is just beside the beams


@pytest.mark.parametrize(
    ("unseen", "at_first", "turned"),
    [("saturate", -1, 1), ("hold", 0, 0.78), ("lost", 0, 0)],
)
def test_a_ball_that_is_not_seen(follow, unseen, at_first, turned):
    """One ball starts behind on the right; another, ahead, leaves the view to the left."""
    scene = replace(exact(follow, unseen=unseen), **OPEN)
    start = make_world(replace(scene, balls=[ball(-1, -0.5)]), [1]).reset()
    assert (start["bearing"].item(), start["seen"].item()) == (at_first, 0)
    assert start["ball_distance_m"] == 8
    env = make_world(replace(scene, balls=[ball(5, 3)]), [1], dtype=torch.float64)
    before = driven(env, 1)  # a turn to the right by 0.19 rad
    assert before["seen"] == 1
    after = driven(env, 1, 1, 1)
    assert after["seen"] == 0
    assert after["bearing"].item() == pytest.approx(turned, abs=0.15)


def test_a_ball_behind_an_obstacle_is_not_seen(follow):
    scene = replace(exact(follow, unseen="lost"), balls=[ball(2, 0)], field_size_m=None)
    post = {**POST, "centre_m": [1.2, 0]}
    assert make_world(replace(scene, obstacles=[post]), [1]).reset()["seen"] == 0
    beside = {**POST, "centre_m": [1.2, 0.31]}
    assert make_world(replace(scene, obstacles=[beside]), [1]).reset()["seen"] == 1


def test_kinds_are_told_apart(follow):
    scene = exact(replace(follow, balls=[ball(2, 1), ball(3, 0, "goal"), ball(2, 0.2, "goal")]))
    vision = replace(scene.sensors.vision, kinds=["goal", "ball"])
    scene = replace(scene, sensors=replace(scene.sensors, vision=vision), **OPEN)
    state = make_world(scene, [1]).reset()
    assert state["goal_bearing"].item() == pytest.approx(0.0997, abs=1e-3)
    assert state["goal_distance_m"].item() == pytest.approx(2.01, abs=1e-3)
    assert state["bearing"].item() == pytest.approx(0.4636, abs=1e-3)


def test_errors_of_the_head(follow):
    vision = replace(follow.sensors.vision, miss_probability=0.2, bearing_noise_rad=0.02)
    scene = replace(
        follow, sensors=replace(follow.sensors, vision=vision), balls=[ball(2, 0)], **OPEN
    )
    state = make_world(scene, [5000]).reset()
    seen = state["seen"] == 1
    assert seen.float().mean().item() == pytest.approx(0.8, abs=0.03)
    assert state["bearing"][seen].std().item() == pytest.approx(0.02, rel=0.05)
    assert state["ball_distance_m"][seen].std().item() == pytest.approx(0.1, rel=0.05)
