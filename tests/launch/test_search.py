"""The search for the best values with Optuna, from the command line to its files."""

import csv
import sys
from collections.abc import Callable, Iterator
from math import log
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser

from fnnq_torchrl.launch import swept_jobs
from fnnq_torchrl.training import job as job_module
from fnnq_torchrl.training.drawing import draw_search
from fnnq_torchrl.training.jobs import Job, JobFailed
from fnnq_torchrl.training.results import Outcome, summarise, write_evaluations, write_summary
from tests.commands import fnnq_train

optuna = pytest.importorskip("optuna", minversion="5")
from optuna.distributions import (  # noqa: E402
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)

from fnnq_torchrl.launch import search as module  # noqa: E402  # imports Optuna
from fnnq_torchrl.launch.search import _distribution, _grid  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")  # those of Optuna and of its libraries

SEARCH = ("hydra/sweeper=optuna", "hydra.launcher.pictures_up_to=0", "-m")
NUMBERS = ("alpha=tag(log,interval(0.05,1))", "lam=interval(0,1)")


def score(job: Job) -> float:
    """A score with its highest value, 5, at alpha=0.3 and lam=0.6."""
    return 5 - log(job.config.alpha / 0.3) ** 2 - (job.config.lam - 0.6) ** 2


def write_results(job: Job) -> float:
    """Write the results of a job with this score."""
    runs = job.config.num_seeds
    scores = np.full((runs, 2), score(job))
    outcome = Outcome(
        seed=job.config.seed + np.arange(runs),
        lam=np.full(runs, job.config.lam),
        situations=np.array([0, 5]),
        steps=np.zeros((runs, 2), dtype=int),
        catches=np.zeros((runs, 2), dtype=int),
        diverged=np.zeros((runs, 2), dtype=bool),
        returns=scores,
        lengths=scores,
        measure="return",
        batch_runs=runs,
        batch_learning_steps=0,
        train_seconds=0.0,
        compile_seconds=0.0,
        evaluate_seconds=0.0,
    )
    (job.directory / "checkpoint.pt").write_bytes(b"")
    write_evaluations(job.directory / "evaluations.csv", outcome)
    write_summary(job.directory / "summary.json", summarise(outcome))
    return float(scores[0, 0])


class Trainings:
    """Batches that are trained as `score` says; ``fail_at`` numbers the first job that fails."""

    def __init__(self) -> None:
        self.batches: list[list[str]] = []
        self.fail_at = 10**6

    def __call__(self, batches: list[list[Job]], **others: object) -> Iterator[list[object]]:
        for batch in batches:
            self.batches.append([job.directory.name for job in batch])
            yield [
                write_results(job)
                if int(job.directory.name) < self.fail_at
                else JobFailed("its disk is full")
                for job in batch
            ]


@pytest.fixture(autouse=True)
def trainings(monkeypatch: pytest.MonkeyPatch) -> Trainings:
    """Replace the trainings, and draw nothing: pictures take longer than all the rest."""
    trainings = Trainings()
    monkeypatch.setattr(job_module, "run_batches", trainings)
    monkeypatch.setattr(module, "draw_search", lambda study, directory: None)
    monkeypatch.setattr("fnnq_torchrl.launch.sweep.draw_sweep", lambda *arguments: None)
    return trainings


@pytest.fixture
def search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Return a function that runs a search in a directory, with settings of the sweeper."""
    monkeypatch.chdir(tmp_path)

    def search(directory: Path, *arguments: str, **settings: object) -> int:
        chosen = [f"hydra.sweeper.{key}={value}" for key, value in settings.items()]
        where = f"hydra.sweep.dir={directory}"
        return fnnq_train(*SEARCH, "task=wander", *arguments, *chosen, where)

    return search


def rows(directory: Path) -> list[dict[str, str]]:
    with open(directory / "summary.csv", newline="") as file:
        return list(csv.DictReader(file))


def best(directory: Path) -> dict[str, object]:
    return yaml.safe_load((directory / "optimization_results.yaml").read_text())


def test_proposals_are_batches_and_the_best_is_told(
    search: Callable[..., int],
    tmp_path: Path,
    trainings: Trainings,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    template = Mock(wraps=swept_jobs._Template)
    monkeypatch.setattr(swept_jobs, "_Template", template)
    assert search(tmp_path / "a", *NUMBERS, "num_seeds=3", n_trials=25, n_jobs=10) == 0
    assert template.call_count == 1
    assert trainings.batches == [[str(i) for i in part] for part in np.split(range(25), [10, 20])]
    jobs = rows(tmp_path / "a")
    assert {job["runs"] for job in jobs} == {"3"}
    found = max(jobs, key=lambda job: float(job["mean_score"]))
    assert best(tmp_path / "a") == {
        "name": "optuna",
        "best_params": {key: float(found[key]) for key in ("alpha", "lam")},
        "best_value": float(found["mean_score"]),
    }
    assert 4.8 < float(found["mean_score"]) < 5
    assert all(0.05 <= float(job["alpha"]) <= 1 for job in jobs)
    out = capsys.readouterr().out
    assert f"best so far: job {found['job']} with " in out.splitlines()[-1]
    tables = out.split("configuration")[1:]
    assert [table.count("│ α = ") for table in tables] == [10, 10, 5]  # only what is new


def test_optunas_figures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "module://of_a_notebook")
    study = optuna.create_study(direction="maximize")
    study.optimize(lambda trial: -(trial.suggest_float("lam", 0, 1) ** 2), n_trials=4)
    draw_search(study, tmp_path)
    names = {"optimization_history.png", "slice.png", "param_importances.png"}
    assert {path.name for path in tmp_path.iterdir()} == names


@pytest.mark.parametrize(
    ("sampler", "storage"),
    [
        ("tpe", "sqlite:///search.db"),
        pytest.param("tpe", "", marks=pytest.mark.long),
        pytest.param("cmaes", "sqlite:///search.db", marks=pytest.mark.long),
    ],
)
def test_the_same_search_again_computes_what_is_missing(
    search: Callable[..., int],
    tmp_path: Path,
    trainings: Trainings,
    sampler: str,
    storage: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    settings = {"sampler": sampler, "n_trials": 16, "n_jobs": 6}
    assert search(tmp_path / "whole", *NUMBERS, **settings) == 0
    trainings.batches.clear()
    trainings.fail_at = 9
    parted = tmp_path / "parted"
    assert search(parted, *NUMBERS, storage=storage, **settings) == 1
    assert capsys.readouterr().err.splitlines()[-1].startswith("job 9 (")
    assert (parted / "optimization_results.yaml").exists()
    trainings.fail_at = 10**6
    assert search(parted, *NUMBERS, storage=storage, **settings) == 0
    assert trainings.batches[2:] == [["9", "10", "11"], ["12", "13", "14", "15"]]
    assert rows(parted) == rows(tmp_path / "whole")
    assert best(parted) == best(tmp_path / "whole")
    assert search(parted, *NUMBERS, storage=storage, **settings) == 0
    assert len(trainings.batches) == 4  # there was nothing to do


def test_a_search_goes_on_in_another_directory_from_its_database(
    search: Callable[..., int], tmp_path: Path, trainings: Trainings
) -> None:
    storage = "sqlite:///search.db"
    assert search(tmp_path / "a", *NUMBERS, storage=storage, n_trials=4, n_jobs=4) == 0
    assert search(tmp_path / "b", *NUMBERS, storage=storage, n_trials=10, n_jobs=4) == 0
    assert [len(batch) for batch in trainings.batches] == [4, 4, 2]
    first, second = ({row["alpha"] for row in rows(tmp_path / name)} for name in "ab")
    assert not first & second
    scores = [float(row["mean_score"]) for name in "ab" for row in rows(tmp_path / name)]
    assert best(tmp_path / "b")["best_value"] == max(scores)


def test_a_proposal_made_twice_is_one_job(
    search: Callable[..., int],
    tmp_path: Path,
    trainings: Trainings,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert search(tmp_path, "trace=output,gradient", n_trials=12, n_jobs=6) == 0
    assert sorted(job for batch in trainings.batches for job in batch) == ["0", "1"]
    assert "6 of 6 proposals repeat earlier jobs" in capsys.readouterr().out


def test_a_grid_is_all_its_jobs_in_order(search: Callable[..., int], tmp_path: Path) -> None:
    grid = ("window=range(1,6,2)", "trace=choice(window,gradient)", "lam=0.5")
    assert search(tmp_path, *grid, sampler="grid") == 0
    found = [(row["window"], row["trace"]) for row in rows(tmp_path)]
    assert found == [(window, trace) for window in "135" for trace in ("window", "gradient")]


def test_the_command_line_replaces_a_preset(search: Callable[..., int], tmp_path: Path) -> None:
    params = "{lam: 'interval(0,1)', alpha: 'interval(0.1,0.2)', situations: '5'}"
    assert search(tmp_path, "alpha=0.5", params=params, n_trials=3, direction="minimize") == 0
    [*_, last] = (tmp_path).glob("[0-9]/.hydra/overrides.yaml")
    assert {"alpha=0.5", "situations=5"} < {*yaml.safe_load(last.read_text())}
    worst = min(float(row["mean_score"]) for row in rows(tmp_path))
    assert best(tmp_path)["best_value"] == worst


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("lam=interval(0,1)", FloatDistribution(0, 1)),
        (
            "alpha=tag(log,interval(0.1,1))",
            FloatDistribution(0.1, 1, log=True),
        ),
        ("window=int(interval(1,9))", IntDistribution(1, 9)),
        ("window=range(1,10)", IntDistribution(1, 9)),
        ("window=range(9,1,-4)", IntDistribution(5, 9, step=4)),
        ("window=tag(log,range(1,65))", IntDistribution(1, 64, log=True)),
        ("lam=range(0,1,0.25)", FloatDistribution(0, 0.75, step=0.25)),
        ("lam=0,0.5", CategoricalDistribution(["0", "0.5"])),
        ("a=choice([1,2],b)", CategoricalDistribution(["[1,2]", "b"])),
    ],
)
def test_a_space_is_what_hydra_means(typed: str, expected: object) -> None:
    [override] = OverridesParser.create().parse_overrides([typed])
    found = _distribution(override)
    assert found == expected
    if override.is_discrete_sweep() and not getattr(found, "log", False):
        grid = [str(each["key"]) for each in _grid({"key": found})]
        assert sorted(grid) == sorted(override.sweep_string_iterator())


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["lam=0.3"], "hydra/sweeper=optuna: there is nothing to search; give a key several "),
        (["lam=range(0)"], "lam=range(0): must have at least one value to sweep"),
        (["lam=tag(log,interval(0,1))"], "lam=tag(log,interval(0,1)): `low > 0` must hold "),
        (["lam=interval(1,0)"], "lam=interval(1,0): "),
        (["lam=interval(2,3)"], "job 0 (task=wander lam="),
        (
            ["lam=interval(0,1)", "hydra.sweeper.sampler=grid"],
            "hydra.sweeper.sampler=grid: lam must have a list or a range of values",
        ),
        (
            ["lam=interval(0,1)", "hydra.sweeper.sampler=gp"],
            "hydra.sweeper.sampler=gp: must be tpe, random, grid or cmaes",
        ),
        (
            ["lam=interval(0,1)", "hydra.sweeper.n_trial=5"],
            "Could not override 'hydra.sweeper.n_trial'. To append to your config use "
            "+hydra.sweeper.n_trial=5; did you mean hydra.sweeper.n_trials?",
        ),
        (
            ["lam=interval(0,1)", "hydra.sweeper.storage=sqlite:///none/search.db"],
            "hydra.sweeper.storage=sqlite:///none/search.db: ",
        ),
        (
            ["lam=interval(0,1)", "hydra.sweeper.storage=nosql:///search.db"],
            "hydra.sweeper.storage=nosql:///search.db: ",
        ),
    ],
)
def test_mistakes_are_one_line(
    search: Callable[..., int],
    tmp_path: Path,
    arguments: list[str],
    line: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert search(tmp_path / "sweep", *arguments) == 2
    told = capsys.readouterr().err
    assert told.startswith(line)
    assert told.count("\n") == 1
    assert not (tmp_path / "sweep").exists()


def test_without_optuna_a_line_says_how_to_install_it(
    search: Callable[..., int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    monkeypatch.delitem(sys.modules, "fnnq_torchrl.launch.search")
    assert search(tmp_path, "lam=interval(0,1)") == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("hydra/sweeper=optuna: needs a library that isn't installed; pip ")
