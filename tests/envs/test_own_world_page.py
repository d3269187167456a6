"""The programs of docs/own_world.md."""

import re
import runpy
from pathlib import Path

import pytest

from fnnq_torchrl.training.results import read_evaluations
from tests.commands import fnnq_train

PAGE = (Path(__file__).parents[2] / "docs" / "own_world.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"\*\*`(\w+\.py)`\*\*.*?```python\n(.*?)```", PAGE, re.DOTALL))
CHAIN, SARSA, *PARTS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def _there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
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


def test_the_parts_of_a_learner_take_a_few_lines() -> None:
    assert [FILES[name] for name in ("capped.py", "share.py", "rms.py")] == PARTS
    for part in PARTS:
        _, _, lines = part.partition("class ")
        assert len([line for line in lines.splitlines() if line]) <= 15


@pytest.mark.usefixtures("_there")
def test_parts_of_ones_own_train_from_the_command_line(tmp_path: Path) -> None:
    commands = re.findall(
        r"^python -m fnnq_torchrl.train (\w+=\w+:.*) num_seeds", PAGE, re.MULTILINE
    )
    assert len(commands) == len(PARTS)
    short = ("env.circle_radius_m=0.5", "situations=5", "num_seeds=2", "engine=eager")
    given = [word for command in commands for word in command.split()]
    assert fnnq_train(*given, *short, f"hydra.run.dir={tmp_path / 'job'}") == 0
    assert read_evaluations(tmp_path / "job" / "evaluations.csv").runs == 2


@pytest.mark.usefixtures("_there")
def test_parts_of_ones_own_learn_in_python(tmp_path: Path) -> None:
    """The program of the page with the trace and the exploration that it describes."""
    own = SARSA.replace('Rule("sarsa", "replacing")', 'Rule("sarsa", Capped())')
    own = own.replace("EpsilonGreedyPolicy(q, epsilon=0.1)", "Share(q, 0.1)")
    heads = "from capped import Capped\nfrom share import Share\n"
    (tmp_path / "own.py").write_text(heads + own.replace("range(500)", "range(250)"))
    assert own.count("Capped") == own.count("Share") == 1
    names = runpy.run_path(str(tmp_path / "own.py"))
    assert names["successes"].mean() > 12
