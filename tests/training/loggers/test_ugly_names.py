"""Every logger and every file of a job in directories whose names mean something elsewhere."""

import os
import shutil
import sys
import warnings
from contextlib import chdir, closing
from pathlib import Path

import pytest

from fnnq_torchrl.training.loggers import Loggers
from tests.commands import fnnq_train
from tests.job_files import write_job
from tests.programs import SMALL_WORLD
from tests.training.loggers.wandb_files import read_wandb_runs

NAMES = [
    *("q?x=1", "p%20q", "#a", "a b", "k=v", "it's", 'say "x"', "a,b", "a\nb", "é λ 世界"),
    *("$HOME", "${lam}", "[0]", "{a}", "~", "-x", "a:b", "a;b&c", "x" * 200),
]
NOT_UTF8 = "\udcff"  # the byte 0xff
QUICK = (*SMALL_WORLD, "situations=5", "engine=eager", "num_seeds=2")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith(("WANDB", "MLFLOW"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("NETRC", str(tmp_path / "no.netrc"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make MLflow's database once, which takes seconds; the copies are found by their names."""
    from mlflow.tracking import MlflowClient

    path = tmp_path_factory.mktemp("mlflow") / "mlflow.db"
    with warnings.catch_warnings(), chdir(path.parent):  # MLflow makes mlruns
        warnings.simplefilter("ignore")
        MlflowClient(f"sqlite:///{path}").search_experiments()
    return path


@pytest.mark.long
def test_loggers_write_into_the_directory_and_nowhere_else(here: Path, database: Path) -> None:
    for name in NAMES:
        directory = here / name
        job = write_job(directory, "num_seeds=2", "logger=[tensorboard,mlflow]")
        shutil.copy(database, directory)
        with warnings.catch_warnings(), closing(Loggers()) as loggers:
            warnings.simplefilter("ignore")
            loggers.log_job(job)
        assert not loggers.left_out, name
        assert (directory / "mlflow.db").stat().st_size > database.stat().st_size - 1
        artifacts = {path.name for path in (directory / "mlartifacts").rglob("*")}
        assert artifacts >= {"evaluations.csv", "summary.json"}, name
        assert list(directory.glob("tensorboard/events*")), name
    assert {path.name for path in here.iterdir()} == {*NAMES}


@pytest.mark.long
def test_wandb_writes_into_the_directory(here: Path) -> None:
    for name in NAMES[:6]:
        job = write_job(here / name, "num_seeds=2", "logger=wandb", "logger.wandb.mode=offline")
        with closing(Loggers()) as loggers:
            loggers.log_job(job)
        assert not loggers.left_out, name
        assert len(read_wandb_runs(job.directory)) == 1, name
    assert {path.name for path in here.iterdir()} == {*NAMES[:6]}


@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux only")
def test_a_name_that_is_not_utf8_is_told_or_works(
    here: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    job = write_job(here / NOT_UTF8, "num_seeds=2", "logger=[tensorboard,mlflow]")
    with closing(Loggers()) as loggers:
        loggers.log_job(job)
    assert loggers.left_out == {"tensorboard", "mlflow"}
    told = capfd.readouterr().err.splitlines()
    assert [line.partition(", which")[0] for line in told] == [
        "going on without tensorboard",
        "going on without mlflow",
    ]
    assert {path.name for path in here.iterdir()} == {NOT_UTF8}


@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux only")
def test_a_command_in_a_directory_that_is_not_utf8_ends_in_a_line_or_works(
    here: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / NOT_UTF8).mkdir()
    monkeypatch.chdir(here / NOT_UTF8)
    for arguments in (("hydra.run.dir=job",), ("lam=0,1", "hydra.sweep.dir=sweep", "-m")):
        status = fnnq_train(*QUICK, *arguments)
        told = capfd.readouterr().err
        assert "Traceback" not in told
        done = [Path("job"), Path("sweep/1")][len(arguments) > 1] / "summary.json"
        assert (status, done.exists()) == (0, True), told


def test_a_job_has_all_its_files_in_a_directory_of_any_name(here: Path) -> None:
    for name in ("q?x=1", "p%20q", "k=v", "a b", "a,b"):
        (here / name).mkdir()
        os.chdir(here / name)
        assert fnnq_train(*QUICK, "hydra.run.dir=job") == 0
        assert {path.name for path in Path("job").iterdir()} >= {"summary.json", "checkpoint.pt"}
