"""The programs of docs/own_world.md."""

import re
import runpy
from pathlib import Path

import pytest

from fnnq_torchrl.training.results import read_evaluations
from tests.commands import fnnq_train

PAGE = (Path(__file__).parents[2] / "docs" / "own_world.md").read_text(encoding="utf-8")
CHAIN, SARSA = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def _there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "chain.py").write_text(CHAIN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)


def test_a_world_takes_thirty_lines() -> None:
    assert len([line for line in CHAIN.splitlines() if line]) <= 30


@pytest.mark.usefixtures("_there")
def test_it_trains_from_the_command_line(tmp_path: Path) -> None:
    (command,) = re.findall(r"^python -m fnnq_torchrl.train (task=own .*)$", PAGE, re.MULTILINE)
    short = ("situations=10", "num_seeds=3", "+env.length=3", "engine=eager")
    assert fnnq_train(*command.split(), *short, f"hydra.run.dir={tmp_path / 'job'}") == 0
    evaluations = read_evaluations(tmp_path / "job" / "evaluations.csv")
    assert evaluations.runs == 3
    assert evaluations.catches.max() == 10


@pytest.mark.usefixtures("_there")
def test_it_learns_in_python(tmp_path: Path) -> None:
    (tmp_path / "sarsa.py").write_text(SARSA)
    names = runpy.run_path(str(tmp_path / "sarsa.py"))
    # With random actions, a run would reach the goal about four times; straight ahead, 83 times.
    assert names["successes"].mean() > 25
