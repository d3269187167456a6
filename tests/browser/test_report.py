"""The report in a browser: `make browser`."""

from pathlib import Path
from typing import Any

import pytest
import torch

from fnnq_torchrl import load_rules
from fnnq_torchrl.studies.report.page import make_report
from fnnq_torchrl.studies.results.collect import collect
from tests.browser.visitor import visited
from tests.job_files import train_job

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Train a sweep of two jobs; return the directory of the second, which is the better one."""
    sweep = tmp_path_factory.mktemp("sweep")
    for name, situations in (("0", 5), ("1", 100)):
        overrides = f"situations={situations}", "num_seeds=2", "checkpoint.snapshots=true"
        train_job(sweep / name, *overrides)
    return sweep / "1"


@pytest.fixture(scope="module")
def text(job: Path) -> str:
    return make_report(job.parent, collect([job.parent]))


@pytest.fixture(scope="module")
def seen(job: Path, text: str) -> dict[str, Any]:
    """Return what a reader of the sweep's report sees."""
    (job.parent / "report.html").write_text(text)
    return visited("visit_report.py", job.parent / "report.html")


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what a reader of the report of a job in a classic world sees."""
    job = tmp_path_factory.mktemp("car")
    world = "task=mountain_car", "value=fnnq", "env.time_limit_steps=40"
    train_job(job, *world, "num_seeds=2", "situations=5", "engine=eager")
    (job / "report.html").write_text(make_report(job, collect([job])))
    return visited("visit_report.py", job / "report.html")


@pytest.mark.parametrize("which", ["seen", "car"])
def test_nothing_is_complained_of_and_nothing_is_clipped(
    which: str, text: str, request: pytest.FixtureRequest
) -> None:
    """Wide and as narrow as a telephone, in the light and in the dark, without a network."""
    of = request.getfixturevalue(which)
    assert of["complaints"] == []
    assert of["violations"] == []
    assert max(of["widths"]) <= 0
    assert len(text) < 6e6


def test_the_charts_are_there_and_fit(seen: dict[str, Any]) -> None:
    titles = [chart["title"] for chart in seen["charts"]]
    assert titles[:3] == ["Learning curves", "Mean scores", "Q over bearing and steer"]
    assert "The consequents while learning" in titles
    for chart in (*seen["charts"], *seen["narrow"]):
        assert chart["marks"] > 0 or chart["title"] == "Mean scores", chart
        assert 200 < chart["width"] <= chart["room"] + 1, chart


def test_the_replay_moves_and_rules_light_up(seen: dict[str, Any], job: Path, text: str) -> None:
    assert seen["moved"]
    assert seen["pressed"] == {"phase": "after", "situation": 0, "at": 1, "playing": False}
    assert seen["chosen"]["situation"] == 2
    assert seen["words"].startswith("Step 0 of")
    assert seen["lit_before_learning"] == []
    assert [ending[:2] for ending in seen["endings"]] == ["1:", "2:", "3:", "4:", "5:"]
    seed = int(text.partition("the run with seed ")[2].partition(" ")[0])
    rules = load_rules(job, seed)
    assert 0 < len(seen["lit"]) < rules.consequents.numel()
    # Each of these rules has a label of the state that another lit rule has, too: they are near.
    rows = torch.tensor(seen["lit"]) // rules.consequents.shape[-1]
    assert rows.unique().numel() < len(rules.inputs[0].labels)


def test_a_classic_world_is_replayed(car: dict[str, Any]) -> None:
    assert car["moved"]
    assert car["pressed"] == {"phase": "after", "situation": 0, "at": 1, "playing": False}
    assert car["words"].startswith("Step 0 of 40: position -0.")
    assert car["lit"]
    assert car["lit_in_view"]
    assert car["lit_before_learning"] == []


def test_it_follows_the_readers_colours(seen: dict[str, Any]) -> None:
    assert seen["text_changes_its_colour"]


def test_no_other_script_runs(seen: dict[str, Any]) -> None:
    assert not seen["hacked"]
