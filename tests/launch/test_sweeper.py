"""Experiments of several grids. Each experiment in ``conf/`` is a list of valid jobs."""

import sys
import types
from pathlib import Path

import pytest
from hydra import compose
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from fnnq_torchrl import train
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.composition import started_hydra
from fnnq_torchrl.launch.launcher import Multirun
from hydra_plugins import fnnq_torchrl as plugin

EXPERIMENTS = {
    "fig2": 4,
    "fig3": 2,
    "fig2_large": 4,
    "fig3_large": 2,
    "traces": 2 * 11,
    "decay": 4 * 5,
    "decay_large": 5,
    "adaptive": 4 * 11 * 2,
    "stability": 2 * 2 * 5,
    "exploration": 3 * 4,
    "extrapolation": 8 * 2,
    "memberships": 3 * (1 + 3 * (1 + 1 + 2) + 2),
    "value_functions": 8 * 5,
    "stream_q": 3,
    "prior": 2 + 3 * 2,
    "simulator": 2 + 1 + 2,
    "variants": 2 * (3 * 3 + 3),
    "open_choices": 2 * 11,
    "sutton_barto_12_6": 2 * 3 * 10 + 3 * 2 * 10,
    "sutton_barto_12_10": 4 * 7,
    "sutton_barto_12_11": 3 * 4 + 3,
    "best_exploration": 9 + 9,
    "chain": 4 * 6 * 2,
    "changing_ball": 2 * 13 * 3,
    "doya": 2 * 3 * 2 + 2,
    "meta_learning": 8 * 10,
    "step_sizes": 2 * 8 * 6,
    "meta_step_sizes": 2 * 5 * 4,
    "step_sizes_car": 7 * 4,
    "sensitivity": 2 * 2 * 3 * 5,
    "sensitivity_values": 2 * 3 * 3,
    "two_states": 24,
    "values": 20,
    "values_sweep": 384,
}


def jobs(cases: list[dict[str, str]], *overrides: str, **settings: int) -> list[list[list[str]]]:
    sweeper = plugin.BatchSweeper(cases)  # from the module, since Hydra makes the class again
    parsed = OverridesParser.create().parse_overrides(list(overrides))
    return sweeper.split_arguments(parsed, settings.get("max_batch_size"))


def test_every_case_is_a_grid_of_its_own() -> None:
    found = jobs([{}, {"a": "1,2"}, {"b": "x", "c": "3,4"}], "lam=0,1")
    assert found == [
        [
            ["lam=0"],
            ["lam=1"],
            *(["a=1", f"lam={lam}"] for lam in (0, 1)),
            *(["a=2", f"lam={lam}"] for lam in (0, 1)),
            *(["b=x", f"c={c}", f"lam={lam}"] for c in (3, 4) for lam in (0, 1)),
        ]
    ]


def test_the_command_line_replaces_a_case_and_no_job_comes_twice() -> None:
    assert jobs([{"a": "1,2"}, {"b": "1"}], "a=7") == [[["a=7"], ["b=1", "a=7"]]]


def test_batches() -> None:
    assert jobs([{"a": "1,2,3"}], max_batch_size=2) == [[["a=1"], ["a=2"]], [["a=3"]]]


def test_every_experiment_is_counted_here() -> None:
    shipped = {path.stem for path in (config_directory() / "experiment").glob("[!_]*.yaml")}
    assert shipped == EXPERIMENTS.keys()


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_an_experiment_is_valid_and_has_so_many_jobs(name: str) -> None:
    with started_hydra():
        node = compose("config", [f"+experiment={name}"], return_hydra_config=True)
    to_config(OmegaConf.masked_copy(node, [key for key in node if key != "hydra"]), own=True)
    assert node.hydra.mode.name == "MULTIRUN"
    sweeper = node.hydra.sweeper
    params = [f"{key}={values}" for key, values in (sweeper.params or {}).items()]
    [batch] = jobs(sweeper.cases, *params)
    assert len(batch) == EXPERIMENTS[name]


@pytest.mark.parametrize("name", ["fig2_large", "exploration"])
def test_an_experiment_is_so_many_jobs_below_its_name(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[tuple[Config, Path]] = []
    stub = types.ModuleType("fnnq_torchrl.training.job")
    stub.run_job = None  # only the launcher "basic" would call it
    stub.run_batches = lambda batches, **others: (
        [taken.append((job.config, job.directory)) or 0.0 for job in batch] for batch in batches
    )
    monkeypatch.setattr(Multirun, "_write_whole", lambda self, first: None)
    monkeypatch.setitem(sys.modules, stub.__name__, stub)
    quiet = ("hydra/job_logging=none", "hydra/hydra_logging=none")
    arguments = (*quiet, f"+experiment={name}")
    monkeypatch.setattr(sys, "argv", ["train", *arguments])
    monkeypatch.chdir(tmp_path)
    train.main()
    assert len(taken) == EXPERIMENTS[name]
    assert {config.num_seeds for config, _ in taken} == {10_000 if "large" in name else 22}
    assert len({repr(config) for config, _ in taken}) == len(taken)
    [sweep] = (tmp_path / "outputs" / name).iterdir()
    assert {directory for _, directory in taken} == {sweep / str(i) for i in range(len(taken))}
    assert {path.name for path in (tmp_path / "outputs").iterdir()} == {name}
