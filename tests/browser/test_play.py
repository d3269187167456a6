"""The page that plays with a learned controller, in a browser: `make browser`."""

import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl import RuleBase, load_policy
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.engine.graphs import leaves, nested
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.studies.play.page import make_page
from fnnq_torchrl.studies.play.program import make_step
from fnnq_torchrl.training.job import run_job
from tests.browser.visitor import visited

pytestmark = pytest.mark.browser

SHORT = "situations=1", "evaluation=none", "engine=eager"
JOBS = {
    "follow": ("situations=100",),
    "follow_obstacles": SHORT,
    "wander": (*SHORT, "env.time_limit_steps=100"),
}
TASKS = pytest.mark.parametrize("task", JOBS)


@cache
def config_of(task: str) -> Config:
    return load_config(f"task={task}", "num_seeds=2", *JOBS[task])


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("jobs")


@pytest.fixture(scope="module")
def seen(jobs: Path) -> dict[str, dict[str, Any]]:
    """Return what a reader of each task's page of seed 1 sees."""
    found = {}
    for task in JOBS:
        (jobs / task).mkdir()
        run_job(config_of(task), jobs / task)
        (jobs / task / "play.html").write_text(make_page(jobs / task, 1))
        found[task] = visited("visit_play.py", jobs / task / "play.html")
    return found


@TASKS
def test_nothing_is_complained_of_and_nothing_is_clipped(
    seen: dict[str, dict[str, Any]], task: str
) -> None:
    """Wide and as narrow as a telephone, in the light and in the dark, without a network."""
    assert seen[task]["complaints"] == []
    assert seen[task]["violations"] == []
    assert max(seen[task]["widths"]) <= 0


@TASKS
@torch.no_grad()
def test_the_browser_computes_what_torch_computes(
    seen: dict[str, dict[str, Any]], jobs: Path, task: str
) -> None:
    network = load_policy(jobs / task, 1).value_network
    step, stays, state = make_step(config_of(task).env, network, 1)

    def given(like: TensorDict, numbers: dict[str, list[str]]) -> TensorDict:
        """Return the browser's numbers for both runs."""
        filled = {}
        for name, leaf in leaves(like).items():
            whole = not leaf.is_floating_point()
            one = torch.tensor([*map(int if whole else float, numbers[name])])
            one = one.abs() if leaf.dtype is torch.bool else one  # true is -1 there
            filled[name] = one.to(leaf.dtype).view(leaf[..., :1].shape).expand(leaf.shape)
        return nested(filled, like)

    for before, after in seen[task]["steps"]:
        ours = leaves(step(given(stays, before), given(state, before)))
        for name, leaf in leaves(given(state, after)).items():
            assert torch.allclose(leaf.double(), ours[name].double(), atol=1e-6), name


@pytest.mark.parametrize("task", ["follow", "follow_obstacles"])
def test_a_drag_moves_the_ball(seen: dict[str, dict[str, Any]], task: str) -> None:
    ball, moved = seen[task]["dragged"], seen[task]["moved"]
    assert ball["held"] == [1]
    corner = 0.8 * seen[task]["half"]
    assert ball["ball_x_m"] == pytest.approx([-corner], abs=0.03)  # below: behind the robot
    assert ball["ball_y_m"] == pytest.approx([corner], abs=0.03)  # on the left
    by_keys = 0 if task == "follow" else 0.1  # there, the second key moves an obstacle
    assert moved["ball_x_m"] == pytest.approx([ball["ball_x_m"][0] + by_keys], abs=1e-3)


def test_the_robot_turns_to_the_ball(seen: dict[str, dict[str, Any]]) -> None:
    assert seen["follow"]["pose"][2] > 0.2


@pytest.mark.parametrize("task", ["follow_obstacles", "wander"])
def test_a_drag_moves_an_obstacle_in_the_robots_way(
    seen: dict[str, dict[str, Any]], task: str
) -> None:
    of = seen[task]
    assert of["disc"] == pytest.approx([0.8, 0], abs=0.03)
    radius = of["dragged"]["disc_radius_m"][0]
    foremost_sonar = 0.17
    assert of["front_m"] == pytest.approx(0.8 - radius - foremost_sonar, abs=0.06)
    assert abs(of["pose"][0]) + abs(of["pose"][1]) > 0.05
    moved = 0 if task == "follow_obstacles" else 1  # the keys move the next thing, after Enter
    before, after = of["dragged"]["disc_x_m"][moved], of["moved"]["disc_x_m"][moved]
    assert after == pytest.approx(before - 0.1, abs=1e-3)


def test_a_changed_number_changes_the_action_and_the_files(
    seen: dict[str, dict[str, Any]], tmp_path: Path
) -> None:
    assert seen["follow"]["actions"] == [-1, 1]
    for name, text in seen["follow"]["files"].items():
        (tmp_path / name).write_text(text)
    expected = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.float64).expand(5, -1)
    for name in ("rules.txt", "rules.fll"):
        assert torch.equal(RuleBase.read(tmp_path / name).consequents, expected)
    compiler = shutil.which("cc")
    if compiler:
        subprocess.run([compiler, "-c", "rules.c", "-o", "rules.o"], cwd=tmp_path, check=True)
