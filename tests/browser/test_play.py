"""The page that plays with a learned controller, in a browser: `make browser`."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl import RuleBase, load_policy
from fnnq_torchrl.engine.graphs import leaves, nested
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.studies.play.page import make_page
from fnnq_torchrl.studies.play.program import make_step
from fnnq_torchrl.training.job import run_job
from tests.browser.visitor import visited

pytestmark = pytest.mark.browser

CONFIG = load_config("num_seeds=2", "situations=100")


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("job")
    run_job(CONFIG, directory)
    return directory


@pytest.fixture(scope="module")
def seen(job: Path) -> dict[str, Any]:
    """Return what a reader of the page of seed 1 sees."""
    (job / "play.html").write_text(make_page(job, 1))
    return visited("visit_play.py", job / "play.html")


def test_nothing_is_complained_of_and_nothing_is_clipped(seen: dict[str, Any]) -> None:
    """Wide and as narrow as a telephone, in the light and in the dark, without a network."""
    assert seen["complaints"] == []
    assert seen["violations"] == []
    assert max(seen["widths"]) <= 0


@torch.no_grad()
def test_the_browser_computes_what_torch_computes(seen: dict[str, Any], job: Path) -> None:
    network = load_policy(job, 1).value_network
    step, stays, state = make_step(CONFIG.env, network, 1)
    before, *afters = seen["states"]

    def given(like: TensorDict, numbers: dict[str, list[str]]) -> TensorDict:
        """Return the browser's numbers for both runs."""
        filled = {}
        for name, leaf in leaves(like).items():
            whole = not leaf.is_floating_point()
            one = torch.tensor([*map(int if whole else float, numbers[name])])
            one = one.abs() if leaf.dtype is torch.bool else one  # true is -1 there
            filled[name] = one.to(leaf.dtype).view(leaf[..., :1].shape).expand(leaf.shape)
        return nested(filled, like)

    for number, after in enumerate(afters):
        before["world/held"] = ["0" if number < 5 else "1"]
        ours = leaves(step(given(stays, before), given(state, before)))
        for name, leaf in leaves(given(state, after)).items():
            assert torch.allclose(leaf.double(), ours[name].double(), atol=1e-6), name
        before = after


def test_a_drag_moves_the_ball_and_the_robot_turns_to_it(seen: dict[str, Any]) -> None:
    ball = seen["dragged"]
    assert ball["held"] == 1
    corner = 0.8 * (CONFIG.env.circle_radius_m + 0.4)
    assert ball["ball_x_m"] == pytest.approx(-corner, abs=0.02)  # below: behind the robot
    assert ball["ball_y_m"] == pytest.approx(corner, abs=0.02)  # on the left
    assert seen["turned"] > 0.2
    assert seen["moved"]["ball_x_m"] == pytest.approx(ball["ball_x_m"] + 0.1)


def test_a_changed_number_changes_the_action_and_the_files(
    seen: dict[str, Any], tmp_path: Path
) -> None:
    assert seen["actions"] == [-1, 1]
    for name, text in seen["files"].items():
        (tmp_path / name).write_text(text)
    expected = torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.float64).expand(5, -1)
    for name in ("rules.txt", "rules.fll"):
        assert torch.equal(RuleBase.read(tmp_path / name).consequents, expected)
    compiler = shutil.which("cc")
    if compiler:
        subprocess.run([compiler, "-c", "rules.c", "-o", "rules.o"], cwd=tmp_path, check=True)
