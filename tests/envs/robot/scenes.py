"""Scenes for the tests: random ones for the oracles, and one with every kind of object."""

from dataclasses import replace
from math import pi

import torch
from hypothesis import strategies as st
from tensordict import TensorDictBase
from torch import Tensor

from envs.robot.arena import Arena
from envs.robot.geometry import Boxes, Discs, Point
from envs.robot.scene import SceneConfig
from tests.oracles import rays

HEADING = st.floats(-pi, pi)
PLACE = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
DISCS = st.lists(
    st.builds(rays.Disc, st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 0.8)), max_size=3
)
BOXES = st.lists(
    st.builds(
        rays.Box,
        st.floats(-2, 2),
        st.floats(-2, 2),
        st.floats(0.1, 1.5),
        st.floats(0.1, 1.5),
        HEADING,
    ),
    max_size=2,
)


def real(number: float | list) -> Tensor:
    """Return numbers as a tensor in float64."""
    return torch.tensor(number, dtype=torch.float64)


def point(spot: tuple[float, float]) -> Point:
    """Return a spot as the world's type."""
    return Point(real(spot[0]), real(spot[1]))


def discs(scene: list[rays.Disc]) -> Discs | None:
    """Return discs as the world's type, ``[discs]``, or None if there are none."""
    columns = torch.tensor(scene, dtype=torch.float64).reshape(-1, 3).T
    return Discs(*columns) if scene else None


def boxes(scene: list[rays.Box]) -> Boxes | None:
    """Return boxes as the world's type, ``[boxes]``, or None if there are none."""
    if not scene:
        return None
    x, y, width, height, heading = torch.tensor(scene, dtype=torch.float64).T
    return Boxes(x, y, width / 2, height / 2, heading)


# -- a scene with everything -----------------------------------------------------------------------

FULL = {
    "clearance_m": 0.05,
    "obstacles": [
        {"shape": "disc", "number": 1, "centre_m": [2.2, 2.2], "radius_m": 0.3},
        {"shape": "disc", "number": 3, "centre_m": [[-2, 2], [-2, 2]], "radius_m": [0.1, 0.3]},
        {
            "shape": "box",
            "number": 1,
            "centre_m": [-2, 2],
            "size_m": [0.6, 0.1],
            "heading_rad": 0.5,
        },
        {
            "shape": "box",
            "number": 2,
            "centre_m": [[-2, 2], [-2, 2]],
            "size_m": [0.5, 0.2],
            "heading_rad": [-3, 3],
        },
    ],
    "balls": [
        {
            "kind": "ball",
            "radius_m": 0.1,
            "paths": [
                {
                    "path": "circle",
                    "centre_m": [0, 0],
                    "radius_m": 1.5,
                    "angle_rad": [-3, 3],
                    "speed_radps": [-0.2, 0.2],
                },
                {
                    "path": "line",
                    "start_m": [[0.5, 1.5], [-1, 1]],
                    "direction_rad": [-3, 3],
                    "speed_mps": [0, 1],
                },
            ],
        },
        {"kind": "goal", "radius_m": 0.2, "paths": [{"path": "still", "start_m": [1, -1]}]},
        {
            "kind": "goal",
            "radius_m": 0.1,
            "paths": [
                {
                    "path": "waypoints",
                    "points_m": [[0, 2], [1, 2], [1, 1]],
                    "speed_mps": 0.3,
                    "closed": True,
                }
            ],
        },
    ],
}


def full_scene(follow: SceneConfig) -> SceneConfig:
    """Return a scene with every kind of object, and sensors that sometimes fail."""
    sonar = replace(follow.sensors.sonar, sees_balls=True, dropout=0.05, max_incidence_deg=40.0)
    vision = replace(
        follow.sensors.vision, kinds=["ball", "goal"], miss_probability=0.1, resolution_rad=0.05
    )
    sensors = replace(follow.sensors, sonar=sonar, vision=vision)
    return replace(follow, sensors=sensors, robot=replace(follow.robot, collision="stop"), **FULL)


def objects(env: Arena, state: TensorDictBase) -> tuple[Boxes, Discs]:
    """Return the boxes and the discs of a state."""
    _, boxes, discs = env.obstacles(dict(state.items()))
    return boxes, discs


def check_state(env: Arena, state: TensorDictBase) -> None:
    """Check that nothing overlaps, and that every number is finite and every reading in range."""
    for key, (low, high) in env.world.observations.items():
        assert ((state[key] >= low) & (state[key] <= high)).all(), key
    least, greatest = env.world.sensors.sonar.range_m
    assert ((state["sonar_m"] >= least) & (state["sonar_m"] <= greatest)).all()
    for key, value in state.items():
        assert value.isfinite().all(), key
    boxes, discs = objects(env, state)
    robot = Point(state["x_m"][:, 0], state["y_m"][:, 0])
    width, height = env.world.field_size_m
    assert (robot.x.abs() < width / 2 - 0.25 + 1e-6).all()
    assert (robot.y.abs() < height / 2 - 0.25 + 1e-6).all()
    gap = torch.hypot(robot.x - discs.x_m, robot.y - discs.y_m) - discs.radius_m
    assert (gap > 0.25 - 1e-5).all()
    at = boxes.in_frame(robot)
    across = (at.x.abs() - boxes.half_width_m).clamp(min=0)
    up = (at.y.abs() - boxes.half_height_m).clamp(min=0)
    assert (torch.hypot(across, up) > 0.25 - 1e-5).all()
