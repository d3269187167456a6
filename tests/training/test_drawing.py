"""Pictures in surroundings that stop Matplotlib, and jobs whose pictures can't be drawn."""

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from matplotlib import rc_context

from fnnq_torchrl.training import drawing
from fnnq_torchrl.training.job import run_batches, run_job
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.pictures import curves
from fnnq_torchrl.training.pictures.curves import learning_curve
from tests.job_files import write_job
from tests.programs import config as load_config

DRAW = """
from pathlib import Path
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.drawing import draw_job
from fnnq_torchrl.training.jobs import Job
draw_job(Job(load_config("situations=40"), Path("job")))
"""
LATIN_1 = "font.family: sansérif\n".encode("latin-1")


@pytest.fixture(scope="module", autouse=True)
def not_blank() -> Iterator[None]:
    """Draw, unlike in all other tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(curves, "learning_curve", learning_curve)
        yield


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the picture of a job, drawn in the usual surroundings."""
    job = write_job(tmp_path_factory.mktemp("usual"))
    drawing.draw_job(job)
    return (job.directory / drawing.PICTURE).read_bytes()


def draw_in(directory: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Draw a job's picture in a process of its own."""
    write_job(directory / "job")
    (directory / "job" / drawing.PICTURE).unlink()
    return subprocess.run(
        [sys.executable, "-c", DRAW],
        cwd=directory,
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=True,
    )


def test_the_users_settings_of_matplotlib_do_not_reach_a_picture(
    tmp_path: Path, usual: bytes
) -> None:
    job = write_job(tmp_path)
    with rc_context({"text.usetex": True, "lines.linewidth": 9, "savefig.transparent": True}):
        drawing.draw_job(job)
    assert (tmp_path / drawing.PICTURE).read_bytes() == usual


def test_settings_that_stop_matplotlib_do_not_stop_a_picture(tmp_path: Path, usual: bytes) -> None:
    (tmp_path / "matplotlibrc").write_bytes(LATIN_1)  # it takes precedence over all others
    done = draw_in(tmp_path, MPLBACKEND="no such one")
    assert (tmp_path / "job" / drawing.PICTURE).read_bytes() == usual
    assert "going on" not in done.stderr


def test_a_picture_without_matplotlib_is_told_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "fnnq_torchrl.training.pictures.curves", None)
    drawing.draw_job(write_job(tmp_path))
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"going on without {tmp_path / drawing.PICTURE}, which can't be drawn: ")
    assert not (tmp_path / drawing.PICTURE).exists()


def broken(*arguments: object) -> None:
    raise RuntimeError("Failed to process string with tex\nbecause latex could not be found")


def test_a_picture_that_cannot_be_drawn_takes_no_number_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(curves, "learning_curve", broken)
    config = load_config("situations=5")
    jobs = [Job(replace(config, seed=seed), tmp_path / str(seed)) for seed in range(2)]
    for job in jobs:
        job.directory.mkdir()
    [results] = run_batches([jobs], pictures=True)
    assert all(isinstance(result, float) for result in results)
    for job in jobs:
        assert {path.name for path in job.directory.iterdir()} == {
            "checkpoint.pt",
            "evaluations.csv",
            "summary.json",
        }
    told = [line for line in capsys.readouterr().err.splitlines() if "can't be drawn" in line]
    assert [line.partition("drawn: ")[2] for line in told] == [
        "Failed to process string with tex because latex could not be found"
    ] * 2

    run_job(config, tmp_path)
    shown = capsys.readouterr()
    assert "can't be drawn" in shown.err
    assert "mean score" in shown.out
    assert "learning curve" not in shown.out
