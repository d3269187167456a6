"""Impossible worlds are refused in one line, before torch is loaded."""

import re
import subprocess
import sys
from math import hypot
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.core.parameters import ConfigError
from envs.robot.scene import BoxConfig, DiscConfig, _gap_to_disc, _reaches
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training import job
from tests.commands import fnnq_train

DISC = "{shape: disc, number: 1, centre_m: [-1, 1], radius_m: 0.3}"
BOX = "{shape: box, number: 1, centre_m: [-1, 1.2], size_m: [0.4, 0.4], heading_rad: 0.3}"
STILL = "{kind: ball, radius_m: 0.1, paths: [{path: still, start_m: [1, 0]}]}"

LINES = {
    "env.obstacles=[{shape: disk, number: 1}]": "env.obstacles[0].shape=disk: must be disc or box",
    "env.obstacles=[{shape: disc, number: 1, center_m: [1, 1], radius_m: 0.3}]": (
        "env.obstacles[0].center_m=[1, 1]: must be one of the keys shape, number, centre_m, "
        "radius_m; did you mean centre_m?"
    ),
    "env.obstacles=[{shape: disc, number: 1, centre_m: [1, 1]}]": (
        "env.obstacles[0].radius_m=???: must be a number, or a range [least, greatest] to draw "
        "from, > 0"
    ),
    "env.obstacles=[{shape: disc, number: 1, centre_m: [1, 1], radius_m: -0.3}]": (
        "env.obstacles[0].radius_m=-0.3: must be a number, or a range [least, greatest] to draw "
        "from, > 0"
    ),
    f"env.obstacles=[{DISC}, {BOX}]": (
        "env.obstacles[1].centre_m=[-1, 1.2]: must be clear of obstacles[0]"
    ),
    f"env.obstacles=[{BOX}, {BOX}]": (
        "env.obstacles[1].centre_m=[-1, 1.2]: must be clear of obstacles[0]"
    ),
    "env.obstacles=[{shape: disc, number: 1, centre_m: [0.5, 0], radius_m: 0.3}]": (
        "env.obstacles[0].centre_m=[0.5, 0]: must be clear of the robot's start"
    ),
    f"env.obstacles=[{DISC.replace('[-1, 1]', '[1, 0]')}] env.balls=[{STILL}]": (
        "env.obstacles[0].centre_m=[1, 0]: must be clear of where balls[0] starts"
    ),
    "env.obstacles=[{shape: disc, number: 2, centre_m: [1, 1], radius_m: 0.3}]": (
        "env.obstacles[0].number=2: must be 1 unless its centre, radius or heading is a range"
    ),
    "env.obstacles=[{shape: disc, number: 1, centre_m: [4, 1], radius_m: 0.3}]": (
        "env.obstacles[0].centre_m=[4, 1]: must be within the field of 6 m x 6 m"
    ),
    "env.obstacles=[{shape: disc, number: 9, centre_m: [[-1, 1], [-1, 1]], radius_m: 0.4}]": (
        "env.obstacles[0].centre_m=[[-1, 1], [-1, 1]]: must be a region with room for 9 obstacles "
        "of 0.4 m with clearance_m=0.2 between them and round the robot"
    ),
    "env.field_size_m=[0.5, 6]": (
        "env.field_size_m=[0.5, 6.0]: must be wider and higher than the robot, 2 · radius_m = 0.5"
    ),
    "env.robot.radius_m=-1": "env.robot.radius_m=-1.0: must be a number in (0, inf)",
    "env.robot.collision=bounce": "env.robot.collision=bounce: must be stop or end",
    "env.balls=[]": "env.sensors.vision.kinds=ball: must be kinds of balls in the scene: none",
    "env.balls=[{kind: ball, radius_m: 0.1, paths: [{path: spiral}]}]": (
        "env.balls[0].paths[0].path=spiral: must be circle or line or still or waypoints"
    ),
    "env.balls=[{kind: ball, radius_m: 0.1, paths: []}]": (
        "env.balls[0].paths=[]: must be a list of at least one path"
    ),
    "env.balls=[{kind: ball, radius_m: 0.1, paths: [{path: waypoints, points_m: [[0, 0], [5, 0]], "
    "speed_mps: 1, closed: true}]}]": (
        "env.balls[0].paths[0].points_m=[[0, 0], [5, 0]]: must be within the field of 6 m x 6 m"
    ),
    "env.sensors.sonar.ring=[[0.1, 0.1]]": (
        "env.sensors.sonar.ring=[[0.1, 0.1]]: must be a list of at least 1 [x_m, y_m, heading_deg]"
    ),
    "env.sensors.sonar.groups.sonar_left_m=[8]": (
        "env.sensors.sonar.groups.sonar_left_m=[8]: must be numbers of sonars, 0 to 7"
    ),
    "env.sensors.vision.kinds=[goal]": (
        "env.sensors.vision.kinds=goal: must be kinds of balls in the scene: ball"
    ),
    "env.sensors.sonar.beam=15": "env.sensors.sonar.beam=15: there is no env.sensors.sonar.beam",
}


@pytest.mark.parametrize("overrides", LINES)
def test_it_is_told_in_one_line(overrides):
    words = overrides.replace("}] env", "}]\nenv").splitlines()
    with pytest.raises(ConfigError) as refused:
        load_config("task=follow_obstacles", *(f"++{word}" for word in words))
    assert str(refused.value).startswith(LINES[overrides])
    assert "\n" not in str(refused.value)


def test_all_that_without_torch():
    script = (
        "import sys; from fnnq_torchrl.launch.composition import load_config; "
        "load_config('task=wander'); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


NUMBERS = st.floats(-2, 2)
SIZES = st.floats(0.05, 3)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(NUMBERS, NUMBERS),
    st.tuples(SIZES, SIZES, st.floats(-4, 4)) | SIZES,
    st.tuples(NUMBERS, NUMBERS),
    st.tuples(SIZES, SIZES) | st.just((0.0, 0.0)),
    st.floats(0.01, 1),
)
def test_a_ball_is_refused_if_it_can_start_in_an_obstacle(centre, shape, corner, size, radius_m):
    """The oracle tries a grid of places in the region where the ball starts."""
    obstacle = (
        DiscConfig("disc", 1, [*centre], shape)
        if isinstance(shape, float)
        else BoxConfig("box", 1, [*centre], [*shape[:2]], shape[2])
    )
    place = [
        [low, low + length] if length else low for low, length in zip(corner, size, strict=True)
    ]
    steps = [i / 40 for i in range(41)]
    tried = [
        _gap_to_disc(obstacle, (corner[0] + size[0] * i, corner[1] + size[1] * j), 0.0)
        for i in steps
        for j in steps
    ]
    between_m = hypot(*size) / 80  # no place is farther from one of the grid
    refused = _reaches(obstacle, place, radius_m)
    assert refused or min(tried) >= radius_m
    assert not refused or min(tried) <= radius_m + between_m + 1e-9


def test_the_field_of_the_page_is_a_field(tmp_path, monkeypatch):
    page = (Path(__file__).parents[3] / "docs" / "worlds.md").read_text(encoding="utf-8")
    [field] = re.findall(r"```yaml\n(.*?obstacles:.*?)```", page, re.DOTALL)
    (tmp_path / "env").mkdir()
    (tmp_path / "env" / "hall.yaml").write_text(field, encoding="utf-8")
    trained = []
    monkeypatch.setattr(job, "run_job", lambda config, directory: trained.append(config) or 1.0)
    words = ("task=follow_obstacles", "env=hall", f"hydra.run.dir={tmp_path / 'job'}")
    assert fnnq_train("--config-dir", str(tmp_path), *words) == 0
    [config] = trained
    assert [each.shape for each in config.env.obstacle_entries] == ["box", "disc"]
    assert config.env.sensors.sonar.beam_width_deg == 15
