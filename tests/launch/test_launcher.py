"""Sweeps, from the command line to the files: a job in a batch equals the job alone."""

import csv
import json
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from fnnq_torchrl.training import job as job_module
from tests.commands import fnnq_train
from tests.programs import SMALL_WORLD

QUICK = (*SMALL_WORLD, "situations=5", "engine=eager")
QUICKEST = (
    "env.time_limit_steps=4",
    "situations=5",
    "engine=eager",
    "hydra.launcher.pictures_up_to=0",
)
SWEEP = ("lam=0,0.4", "seed=3,8", "num_seeds=2", *QUICK)


class Ended(NamedTuple):
    status: int
    stdout: str
    stderr: str


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    def command(*arguments: object) -> Ended:
        return Ended(fnnq_train(*arguments), *capsys.readouterr())

    return command


@pytest.fixture(scope="module")
def folded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("folded")
    assert fnnq_train(*SWEEP, f"hydra.sweep.dir={directory}", "-m") == 0
    return directory


def summary(job: Path) -> dict[str, object]:
    return json.loads((job / "summary.json").read_text())


def rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_jobs_are_the_same_folded_and_one_by_one(folded: Path, tmp_path: Path) -> None:
    some = ("lam=0,0.4", "seed=8", *SWEEP[2:], f"hydra.sweep.dir={tmp_path}")
    assert fnnq_train(*some, "hydra/launcher=basic", "-m") == 0
    for number, alone in ((1, tmp_path / "0"), (3, tmp_path / "1")):
        ours = folded / str(number)
        assert {path.name for path in ours.iterdir()} == {path.name for path in alone.iterdir()}
        for name in (
            "evaluations.csv",
            "checkpoint.pt",
            "learning_curve.png",
            "train.log",
            ".hydra/config.yaml",
            ".hydra/overrides.yaml",
        ):
            assert (ours / name).read_bytes() == (alone / name).read_bytes(), name
        mine, other = summary(ours), summary(alone)
        assert (mine.pop("batch_runs"), other.pop("batch_runs")) == (8, 2)
        times = {key for key in mine if "second" in key}
        assert {key: mine[key] for key in mine.keys() - times} == {
            key: other[key] for key in other.keys() - times
        }


def test_a_job_alone_is_the_job_folded(folded: Path, tmp_path: Path) -> None:
    alone = ("lam=0.4", "seed=3", "num_seeds=2", *QUICK, f"hydra.run.dir={tmp_path}")
    assert fnnq_train(*alone) == 0
    for name in ("evaluations.csv", "checkpoint.pt", "learning_curve.png", ".hydra/config.yaml"):
        assert (tmp_path / name).read_bytes() == (folded / "2" / name).read_bytes(), name


def test_the_sweep_has_the_whole(folded: Path) -> None:
    assert {path.name for path in folded.iterdir() if path.is_file()} == {
        "evaluations.csv",
        "learning_curves.png",
        "multirun.yaml",
        "summary.csv",
    }
    evaluations = rows(folded / "evaluations.csv")
    of_the_jobs = [rows(folded / str(number) / "evaluations.csv") for number in range(4)]
    assert evaluations == [
        row | {"job": str(number)} for number, each in enumerate(of_the_jobs) for row in each
    ]
    summaries = rows(folded / "summary.csv")
    assert [(row["job"], row["lam"], row["seed"]) for row in summaries] == [
        ("0", "0.0", "3"),
        ("1", "0.0", "8"),
        ("2", "0.4", "3"),
        ("3", "0.4", "8"),
    ]
    for number, row in enumerate(summaries):
        assert float(row["mean_score"]) == summary(folded / str(number))["mean_score"]


@pytest.fixture
def batches(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Return a list that collects the job names of each batch trained from now on."""
    seen: list[list[str]] = []
    run = job_module.run_batches

    def noted(batches, **others):
        seen.extend([each.directory.name for each in batch] for batch in batches)
        return run(batches, **others)

    monkeypatch.setattr(job_module, "run_batches", noted)
    return seen


def test_the_same_sweep_again_computes_what_is_missing(
    folded: Path, tmp_path: Path, batches: list[list[str]]
) -> None:
    again = (*SWEEP, f"hydra.sweep.dir={folded}", "-m")
    before = {path: path.read_bytes() for path in folded.rglob("*.csv")}
    picture = (folded / "1" / "learning_curve.png").read_bytes()
    (folded / "1" / "learning_curve.png").unlink()  # as after a kill, since it is drawn last
    assert fnnq_train(*again) == 0
    assert batches == []
    assert (folded / "1" / "learning_curve.png").read_bytes() == picture
    (folded / "2" / "summary.json").unlink()
    (folded / "2" / "evaluations.csv").unlink()
    assert fnnq_train(*again) == 0
    assert batches == [["2"]]
    (folded / "summary.csv").unlink()
    before.pop(folded / "summary.csv")
    assert {path: path.read_bytes() for path in folded.rglob("*.csv")} == before


def files_of_jobs(sweep: Path) -> set[Path]:
    return {path for path in sweep.glob("[0-9]/**/*") if path.is_file()}


def test_what_a_kill_at_the_very_end_has_left_is_cleared_away(
    folded: Path, batches: list[list[str]]
) -> None:
    before = files_of_jobs(folded)
    half = ".config.yaml.0123456789abcdef.tmp"
    for left in (folded / "2" / "training.pt", folded / "0" / half):
        left.write_bytes(b"")
    assert fnnq_train(*SWEEP, f"hydra.sweep.dir={folded}", "-m") == 0
    assert batches == []
    assert files_of_jobs(folded) == before
    (folded / "1" / "summary.json").unlink()
    (folded / "1" / ".hydra" / half).write_bytes(b"")
    assert fnnq_train(*SWEEP, f"hydra.sweep.dir={folded}", "-m") == 0
    assert files_of_jobs(folded) == before


def test_another_sweep_may_not_have_the_directory(
    folded: Path, command: Callable[..., Ended], batches: list[list[str]]
) -> None:
    before = {path: path.read_bytes() for path in folded.glob("*/**/*") if path.is_file()}
    other = ["lam=0,0.5" if override == "lam=0,0.4" else override for override in SWEEP]
    status, _, stderr = command(*other, f"hydra.sweep.dir={folded}", "-m")
    assert status == 2
    assert stderr.count("\n") == 1
    assert stderr.startswith("job 2 (lam=0.5 seed=3 num_seeds=2 ")
    assert f"{folded / '2'} holds a job with lam=0.4, not lam=0.5; name another" in stderr
    assert not batches
    assert {path: path.read_bytes() for path in folded.glob("*/**/*") if path.is_file()} == before


def test_a_job_that_diverges_is_counted_and_spoils_no_other(
    tmp_path: Path, command: Callable[..., Ended]
) -> None:
    sweep = ("alpha=0.4,1e30", "num_seeds=2", *QUICKEST, f"hydra.sweep.dir={tmp_path}")
    status, _, stderr = command(*sweep, "-m")
    assert status == 0
    assert "diverged: 2 of 4 runs (seed 0 of job 1, 1 of job 1); they stopped" in stderr
    summaries = rows(tmp_path / "summary.csv")
    assert [row["diverged_runs"] for row in summaries] == ["0", "2"]
    assert summaries[1]["mean_score"] == "0.0"
    evaluations = rows(tmp_path / "evaluations.csv")
    assert {row["alpha"] for row in evaluations if row["diverged"] == "1"} == {"1e+30"}


def test_a_file_that_cant_be_written_fails_its_own_job_and_the_last(
    tmp_path: Path, command: Callable[..., Ended]
) -> None:
    (tmp_path / "0" / "evaluations.csv").mkdir(parents=True)
    sweep = ("seed=0,1,2", *QUICKEST, f"hydra.sweep.dir={tmp_path}", "-m")
    status, _, stderr = command(*sweep)
    assert status == 1
    assert "job 0 (seed=0 " in stderr
    assert "evaluations.csv" in stderr.splitlines()[-1]
    assert (tmp_path / "1" / "summary.json").exists()
    assert not (tmp_path / "2" / "summary.json").exists()  # the training is saved there
    (tmp_path / "0" / "evaluations.csv").rmdir()
    assert command(*sweep).status == 0


def test_a_batch_that_breaks_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = job_module._run_batch

    def breaks(batch, *others):
        if batch.config.trace == "output":
            raise ZeroDivisionError("a bug")
        return run(batch, *others)

    monkeypatch.setattr(job_module, "_run_batch", breaks)
    sweep = ("trace=output,gradient", "seed=0,1", *QUICKEST, f"hydra.sweep.dir={tmp_path}", "-m")
    with pytest.raises(ZeroDivisionError, match="a bug"):
        fnnq_train(*sweep)
    finished = [number for number in range(4) if (tmp_path / f"{number}/summary.json").exists()]
    assert finished == [2, 3]
    assert [row["runs"] for row in rows(tmp_path / "summary.csv")] == ["", "", "1", "1"]


@pytest.fixture
def untrained(monkeypatch: pytest.MonkeyPatch) -> list[tuple[list[list[str]], bool]]:
    """Return a list that collects the job names of untrained batches, and if they have pictures."""
    calls: list[tuple[list[list[str]], bool]] = []

    def run_batches(batches, *, pictures, **others):
        calls.append(([[each.directory.name for each in batch] for batch in batches], pictures))
        return ([float(each.config.seed) for each in batch] for batch in batches)

    monkeypatch.setattr(job_module, "run_batches", run_batches)
    return calls


@pytest.mark.parametrize(
    ("arguments", "batches", "pictures"),
    [
        (["seed=range(3)"], [["0", "1", "2"]], True),
        (["seed=range(21)"], [[str(number) for number in range(21)]], False),
        (["seed=range(3)", "hydra.launcher.pictures_up_to=2"], [["0", "1", "2"]], False),
        (["seed=range(3)", "hydra.launcher.max_batch_size=2"], [["0", "1"], ["2"]], True),
        (["seed=0,10", "trace=output,gradient"], [["0", "2"], ["1", "3"]], True),
        (["alpha=0.1,0.2", "epsilon=0,1", "gamma=0.9"], [["0", "1", "2", "3"]], True),
    ],
)
def test_batches(
    arguments: list[str],
    batches: list[list[str]],
    pictures: bool,
    tmp_path: Path,
    untrained: list[tuple[list[list[str]], bool]],
) -> None:
    assert fnnq_train(*arguments, f"hydra.sweep.dir={tmp_path}", "-m") == 0
    assert untrained == [(batches, pictures)]


def test_jobs_may_not_share_a_directory(
    tmp_path: Path, command: Callable[..., Ended], untrained: list[object]
) -> None:
    places = (f"hydra.sweep.dir={tmp_path}", "hydra.sweep.subdir=here")
    status, _, stderr = command("seed=0,1", *places, "-m")
    assert status == 2
    assert stderr == (
        f"job 1 (seed=1): {tmp_path / 'here'} is also the directory of job 0 (seed=0); "
        "hydra.sweep.subdir must differ between jobs\n"
    )
    assert not untrained


def test_callbacks_come_in_pairs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, untrained: list[object]
) -> None:
    from hydra.experimental.callback import Callback

    calls = []

    class Noting(Callback):
        def on_job_start(self, config, *, task_function, **kwargs):
            calls.append(("start", config.seed, config.hydra.job.num))

        def on_job_end(self, config, job_return, **kwargs):
            calls.append(("end", job_return.cfg.seed, job_return.return_value))

    module = types.ModuleType("noting")
    module.Noting = Noting  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "noting", module)
    callback = "+hydra.callbacks.noting._target_=noting.Noting"
    assert fnnq_train("seed=4,5", callback, f"hydra.sweep.dir={tmp_path}", "-m") == 0
    assert calls == [("start", 4, 0), ("end", 4, 4.0), ("start", 5, 1), ("end", 5, 5.0)]
