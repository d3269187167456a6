"""The arithmetic of the ROS node; ROS itself can't be installed here."""

import ast
import runpy
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from envs.robot.kinematics import drive, wheel_speeds

PATH = Path(__file__).parents[2] / "examples" / "ros2_follow.py"
NODE = runpy.run_path(str(PATH))


@pytest.mark.parametrize("steering", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_the_command_turns_as_the_simulated_wheels_do(steering: float) -> None:
    speed, turn = NODE["twist"](steering, 0.3, 0.321)
    action, zero = torch.tensor(steering).double(), torch.zeros(()).double()
    _, _, heading = drive(zero, zero, zero, *wheel_speeds(action, 0.3), 0.321, 0.1)
    assert turn * 0.1 == pytest.approx(heading.item())
    assert speed == 0.3


def test_it_observes_the_least_of_each_group() -> None:
    sonar = SimpleNamespace(groups={"left": [0, 1], "right": [2]}, range_m=[0.1, 5.0])
    seen = NODE["observe"](0.2, [3.0, 1.0, 2.0], sonar)
    assert seen == {"bearing": 0.2, "left": 1.0, "right": 2.0}
    assert NODE["observe"](0.2, [], None) == {"bearing": 0.2}


@pytest.mark.parametrize(("heard", "read"), [(inf, 5.0), (nan, 5.0), (9.0, 5.0), (-inf, 0.1)])
def test_a_range_without_an_echo_is_the_greatest(heard: float, read: float) -> None:
    """REP 117: +inf is no echo, −inf is an object nearer than the least range."""
    sonar = SimpleNamespace(groups={"ahead": [0]}, range_m=[0.1, 5.0])
    assert NODE["observe"](0.0, [heard], sonar)["ahead"] == read


def test_it_is_short_and_asks_for_ros_only_where_it_runs() -> None:
    text = PATH.read_text()
    assert len(text.splitlines()) <= 60
    top = [node for node in ast.parse(text).body if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = {getattr(node, "module", None) or node.names[0].name for node in top}
    assert modules == {"sys", "typing"}
