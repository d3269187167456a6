"""``from=DIR`` takes the configuration of an earlier job; what else is typed changes it."""

import re
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import pytest
import yaml

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.loggers import LoggerConfig
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training import job as job_module
from tests.commands import fnnq_train

EARLIER = (
    "value=mlp",
    "value.widths=[7,5]",
    "step_size=obgd",
    "lam=0.7",
    "seed=3",
    "alpha=${lam}",
    "env.speed_mps=0.5",
    "checkpoint.snapshots=true",
    "logger=[csv,tensorboard]",
)


@pytest.fixture
def trained(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Config]:
    """Return a list that collects the jobs that would be trained; commands run in ``tmp_path``."""
    configs: list[Config] = []

    def run_job(config: Config, directory: Path) -> float:
        configs.append(config)
        return 1.0

    monkeypatch.setattr(job_module, "run_job", run_job)
    monkeypatch.setattr(
        job_module,
        "run_batches",
        lambda batches, **others: ([run_job(j.config, j.directory) for j in b] for b in batches),
    )
    monkeypatch.setattr(
        "fnnq_torchrl.launch.launcher.Multirun._write_whole", lambda self, first: None
    )
    monkeypatch.chdir(tmp_path)
    return configs


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Config]:
    """Return the directory that the command made for a job, and the job's configuration."""
    configs: list[Config] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(job_module, "run_job", lambda config, directory: configs.append(config))
        directory = tmp_path_factory.mktemp("earlier")
        assert fnnq_train(*EARLIER, f"hydra.run.dir={directory}") == 0
    return directory, configs[0]


@pytest.fixture
def earlier(written: tuple[Path, Config], trained: list[Config], tmp_path: Path) -> Config:
    """Put the job into the directory ``earlier``; return the configuration of ``from=earlier``."""
    shutil.copytree(written[0], tmp_path / "earlier")
    return replace(written[1], logger=LoggerConfig())  # the job's own loggers aren't taken


@pytest.mark.parametrize(
    "task",
    ["${fresh_directory:made}", "${nope:x}", [1, 2], "../task", {"a": 1}],
    ids=["a call", "an unknown call", "a list", "a path", "a mapping"],
)
def test_nothing_in_it_is_called(earlier: Config, task: object, tmp_path: Path) -> None:
    path = tmp_path / "earlier" / ".hydra" / "hydra.yaml"
    path.write_text(yaml.safe_dump({"hydra": {"runtime": {"choices": {"task": task}}}}))
    assert load_config("from=earlier") == earlier
    assert not (tmp_path / "made").exists()


def test_a_call_that_is_put_together_is_refused(earlier: Config, tmp_path: Path) -> None:
    path = tmp_path / "earlier" / ".hydra" / "config.yaml"
    plain = yaml.safe_load(path.read_text())
    plain["exploration"] = "${engine}{oc.env:HOME}"
    path.write_text(yaml.safe_dump(plain))
    with pytest.raises(ConfigError, match=r"config\.yaml: exploration="):
        load_config(f"from={tmp_path / 'earlier'}")


def test_it_is_the_same_job(earlier: Config, trained: list[Config]) -> None:
    assert fnnq_train("from=earlier") == 0
    assert trained == [earlier]
    assert (earlier.alpha, earlier.value.widths) == (0.7, [7, 5])


def test_what_else_is_typed_changes_it(earlier: Config, trained: list[Config]) -> None:
    assert fnnq_train("lam=0.5", "from=earlier", "seed=7", "value.widths=[9]") == 0
    value = replace(earlier.value, widths=[9])
    assert trained == [replace(earlier, lam=0.5, seed=7, value=value)]


def test_a_choice_replaces_all_of_its_group(earlier: Config) -> None:
    default = load_config()
    config = load_config("from=earlier", "value=fnnq", "logger=csv")
    assert config == replace(earlier, value=default.value, logger=default.logger)
    config = load_config("from=earlier", "step_size=decay")
    assert config == replace(earlier, step_size="decay", alpha_decay=0.99)


def test_a_task_replaces_all_that_it_chooses(earlier: Config) -> None:
    config, default = load_config("from=earlier", "task=follow"), load_config()
    assert config == replace(earlier, env=default.env)
    world = load_config("from=earlier", "env=follow_one_side", "evaluation=random")
    assert (world.env.start_side, world.evaluation.tests) == ("left", 10)
    assert world.env.speed_mps == default.env.speed_mps


def test_a_sweep_from_it(earlier: Config, trained: list[Config]) -> None:
    assert fnnq_train("from=earlier", "lam=0,0.5", "value=mlp,table", "-m") == 0
    chosen = [load_config("value=mlp"), load_config("value=table")]
    assert trained == [
        replace(earlier, lam=lam, value=config.value, alpha=config.alpha)
        for config in chosen
        for lam in (0.0, 0.5)
    ]


def test_an_experiment_from_it(earlier: Config, trained: list[Config]) -> None:
    assert fnnq_train("from=earlier", "+experiment=fig2") == 0
    assert trained == [replace(earlier, num_seeds=22, lam=lam) for lam in (0, 0.1, 0.4, 0.8)]


def test_its_own_directory_may_be_gone_on_with(earlier: Config, trained: list[Config]) -> None:
    assert fnnq_train("from=earlier", "hydra.run.dir=earlier") == 0
    assert fnnq_train("from=earlier", "hydra.run.dir=another") == 0
    assert trained == [earlier, earlier]
    saved = [Path(name, ".hydra/config.yaml").read_text() for name in ("earlier", "another")]
    assert saved[0] == saved[1]


@pytest.fixture
def edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Return a function that makes a directory ``job`` with an edited configuration."""
    monkeypatch.chdir(tmp_path)
    path = Path("job/.hydra/config.yaml")
    path.parent.mkdir(parents=True)

    def edit(changes: dict[object, object]) -> Path:
        path.write_text(yaml.safe_dump(asdict(load_config()) | changes))
        return path

    return edit


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"lamm": 1}, "lamm=1: there is no lamm; did you mean lam?"),
        ({"lam": 7}, "lam=7.0: must be a number in [0, 1]"),
        ({"lam": "???"}, "lam=???: must be a number in [0, 1]"),
        ({"_target_": "os.abort"}, "_target_=os.abort: there is no _target_; there is lam, …"),
        ({"hydra": {"mode": "MULTIRUN"}}, "hydra={'mode': 'MULTIRUN'}: there is no hydra; …"),
        ({"value": {"kind": "fnnq", "_target_": "os.abort"}}, "value._target_=os.abort: there …"),
        ({"engine": "${oc.env:HOME}"}, "engine=${oc.env:HOME}: must be a plain value"),
        ({"engine": "\\${oc.env:HOME}"}, "engine=\\${oc.env:HOME}: must be a plain value"),
        ({1: 2}, "1: there is no 1; there is lam, …"),
        (
            {"value": {"kind": "antigravity:fly"}},
            "value.kind=antigravity:fly names code from outside fnnq_torchrl; "
            "if you trust it, add value.kind=antigravity:fly to the command",
        ),
    ],
)
def test_what_isnt_valid_is_refused_in_a_line(
    edit: Callable[..., Path], changes: dict[object, object], line: str
) -> None:
    path = edit(changes)
    with pytest.raises(ConfigError) as refused:
        load_config("from=job")
    told = str(refused.value)
    if line.endswith("…"):
        told = told[: len(f"{path}: {line}") - 1] + "…"
    assert told == f"{path}: {line}"


@pytest.mark.parametrize("text", ["", "\0\0", "lam: [0", "lam", "a: !!python/object:os.abort {}"])
def test_a_damaged_configuration_is_refused(edit: Callable[..., Path], text: str) -> None:
    edit({}).write_text(text)
    with pytest.raises(ConfigError, match=r"^job/\.hydra/config\.yaml is damaged, or not a"):
        load_config("from=job")


def test_code_of_ones_own_runs_if_it_is_typed(
    edit: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    Path("of_mine.py").write_text(
        "from fnnq_torchrl.config.values import MLPConfig\nclass Mine: schema = MLPConfig\n"
    )
    value = asdict(load_config("value=mlp").value) | {"kind": "of_mine:Mine"}
    edit({"value": value})
    assert load_config("from=job", "value.kind=of_mine:Mine").value.kind == "of_mine:Mine"
    with pytest.raises(ConfigError, match=r"add value\.kind=of_mine:Mine to the command$"):
        load_config("from=job")


@pytest.mark.parametrize(
    ("env", "named"),
    [
        ({"kind": "gymnasium", "id": "of_mine:Maze-v0"}, "env.id=of_mine:Maze-v0"),
        (
            {"kind": "torchrl:torchrl.envs:PendulumEnv", "arguments": {}},
            "env.kind=torchrl:torchrl.envs:PendulumEnv",
        ),
        ({"kind": "gymnasium", "id": "CartPole-v1", "arguments": {"x": 1}}, "env.arguments.x=1"),
    ],
)
def test_an_environments_module_is_imported_only_if_it_is_typed(
    edit: Callable[..., Path], tmp_path: Path, env: dict[str, object], named: str
) -> None:
    path = edit({"env": {**env, "time_limit_steps": 9}})
    with pytest.raises(ConfigError, match=f"add {re.escape(named)} to the command$"):
        load_config("from=job")
    with pytest.raises(ConfigError, match=r"untrusted|names code from outside"):
        to_config(yaml.safe_load(path.read_text()))
