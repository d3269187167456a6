"""A world of the user's own, from docs/worlds.md."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from torchrl.envs import check_env_specs

from envs import make_world
from envs.core.contract import check_world
from envs.core.parameters import ConfigError
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.trainer import Trainer
from tests.commands import fnnq_train

PAGE = Path(__file__).parents[2] / "docs" / "worlds.md"


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory that has only the files of docs/worlds.md."""
    root = tmp_path_factory.mktemp("own")
    files = re.findall(
        r"\*\*`([\w./]+)`\*\*.*?```(?:python|yaml)\n(.*?)```", PAGE.read_text(), re.DOTALL
    )
    for name, text in files:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    assert len(files) == 5
    return root


@pytest.fixture
def there(directory: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(directory)
    monkeypatch.syspath_prepend(directory)
    return directory


def config(directory: Path, *overrides: str) -> Config:
    return load_config(f"hydra.searchpath=[{(directory / 'my_conf').as_uri()}]", *overrides)


def test_it_is_an_environment(there: Path) -> None:
    env = make_world(config(there, "task=point").env, [3], seed=0)
    check_env_specs(env)
    check_world(env)
    history = env.rollout(200, break_when_any_done=False)["next"]
    assert (history["step"] <= 60).all()
    assert history["truncated"].any()
    assert (history["success"] == history["terminated"]).all()


@pytest.mark.parametrize("value", ["fnnq", "mlp", "tiles"])
def test_it_trains_with_any_value_function(there: Path, value: str) -> None:
    trainer = Trainer.of(
        config(there, "task=point", f"value={value}", "alpha=0.05", "situations=5", "engine=eager")
    )
    trainer.learn()
    outcome = trainer.evaluate()
    assert outcome.catches.max() <= 10
    assert (outcome.returns * 10 == outcome.catches).all()
    assert any((weight != 0).any() for weight in trainer.weights.values())


@pytest.mark.usefixtures("compiler")
def test_eager_and_compiled_learn_the_same(there: Path) -> None:
    weights = []
    for engine in ("eager", "compiled"):
        trainer = Trainer.of(
            config(there, "task=point", "situations=5", "num_seeds=3", f"engine={engine}")
        )
        trainer.learn()
        weights.append(trainer.weights["weight"])
    torch.testing.assert_close(*weights, rtol=1e-4, atol=1e-6)


@pytest.mark.usefixtures("compiler")
def test_one_that_looks_at_its_data_is_told_so_by_the_compiler(there: Path) -> None:
    right = "        reward = there"
    text = (there / "point.py").read_text()
    assert right in text
    looks = text.replace(right, f"        if there.any():\n            there = ~~there\n{right}", 1)
    (there / "looking_point.py").write_text(looks)
    looking = config(there, "task=point", "env.kind=looking_point:Point", "engine=compiled")
    with pytest.raises(ConfigError, match=r"^engine=compiled: a world .* looks at its data"):
        Trainer.of(looking).learn()


def test_it_is_one_word_on_the_command_line(there: Path) -> None:
    arguments = ("--config-dir", "my_conf", "task=point", "situations=5", "engine=eager")
    assert fnnq_train(*arguments, f"hydra.run.dir={there / 'job'}") == 0
    assert read_evaluations(there / "job" / "evaluations.csv").runs == 1


def test_fnnq_train_finds_it_in_the_current_directory(directory: Path) -> None:
    """A console script doesn't have the current directory on its path."""
    script = "import sys; sys.path.pop(0); from fnnq_torchrl.train import main; main()"
    arguments = ("--config-dir", "my_conf", "task=point", "--cfg", "job")
    ended = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        cwd=directory,
        check=True,
        capture_output=True,
        text=True,
    )
    assert "kind: point:Point" in ended.stdout


MISTAKES = {
    "no success that is a number": (
        '"success": there}',
        '"success": reward}',
        "after a step the entry success is torch.float32 [2, 1]; it must be torch.bool [2, 1]",
    ),
    "no success": (
        ', "success": there}',
        "}",
        "its transition must return success for the measure 'successes'",
    ),
    "no observation": (
        '"y_m": y_m, "reward"',
        '"reward"',
        "its first step fails: KeyError",
    ),
    "no reward": (
        '"reward": reward, ',
        "",
        "after a step the entry reward is missing; it must be torch.float32 [2, 1]",
    ),
    "another shape": (
        "reward = there.to(self.dtype)",
        "reward = there.to(self.dtype).squeeze(-1)",
        "after a step the entry reward is torch.float32 [2]; it must be torch.float32 [2, 1]",
    ),
    "another dtype": (
        "reward = there.to(self.dtype)",
        "reward = there.double()",
        "after a step the entry reward is torch.float64 [2, 1]; it must be torch.float32 [2, 1]",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_its_mistakes_are_told_in_one_line(
    there: Path, mistake: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    right, wrong, told = MISTAKES[mistake]
    text = (there / "point.py").read_text()
    assert right in text
    (there / "wrong_point.py").write_text(text.replace(right, wrong))
    monkeypatch.delitem(sys.modules, "wrong_point", raising=False)
    world = make_world(config(there, "task=point", "env.kind=wrong_point:Point").env, [2], seed=0)
    with pytest.raises(ConfigError, match=r"^env\.kind=wrong_point:Point: ") as refused:
        check_world(world)
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (
            ("env.kind=point:Pont",),
            "env.kind=point:Pont: module 'point' has no attribute 'Pont'; did you mean Point?",
        ),
        (
            ("env.kind=math:pi",),
            "env.kind=math:pi: its attribute schema must be a dataclass derived from Parameters",
        ),
        (
            ("action=even",),
            "action.candidates=21: must be null, for all 4 actions of point:Point",
        ),
        (
            ("evaluation=paper",),
            "evaluation.situations=[[0.8, 0.1], [-0.8, -0.1], [0.4, -0.15], [-0.4, 0.15], "
            "[0.0, 0.12]]: must be the number of random starts: point:Point has no fixed starts",
        ),
        (
            ("exploration=noise",),
            "exploration=noise: must be epsilon_greedy or boltzmann: point:Point has a fixed set "
            "of actions",
        ),
        (("env.stride_m=0",), "env.stride_m=0.0: must be a number in (0, inf)"),
    ],
)
def test_its_configuration_is_checked_too(
    there: Path, overrides: tuple[str, ...], line: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        config(there, "task=point", *overrides)
    assert str(refused.value) == line


def test_a_class_that_is_no_world_is_refused(there: Path) -> None:
    (there / "thing.py").write_text(
        "from point import PointConfig\nclass Thing:\n    schema = PointConfig\n"
    )
    with pytest.raises(ConfigError, match=r"^env\.kind=thing:Thing: must be a subclass of Pure"):
        make_world(config(there, "task=point", "env.kind=thing:Thing").env, [2], seed=0)
