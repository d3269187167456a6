"""Several loggers at once: none changes the results, and none can stop the training."""

import sys
from pathlib import Path
from typing import ClassVar

import pytest
from PIL import Image

from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training import drawing, watching
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.loggers import Loggers
from fnnq_torchrl.training.loggers.registry import LOGGERS
from tests.commands import fnnq_train
from tests.programs import SMALL_WORLD

QUICK = (*SMALL_WORLD, "situations=5", "engine=eager")
FILES = ("checkpoint.pt", "evaluations.csv", "learning_curve.png", "summary.json")


class Recording:
    """A logger that records its calls, and fails at the end if told to."""

    log: ClassVar[list[str]] = []
    fails: ClassVar[tuple[str, ...]] = ()

    def __init__(self, name: str) -> None:
        self._name = name

    def prepare(self, jobs) -> None:
        self._take_down(f"begins {len(jobs)}")

    def log_job(self, job) -> None:
        video = "" if job.video is None else f", {job.video.name}"
        self._take_down(f"{job.name} of {job.group}: {job.evaluations.runs} runs{video}")

    def log_sweep(self, sweep) -> None:
        self._take_down(f"{sweep.name}, {[path.name for path in sweep.pictures]}")

    def close(self) -> None:
        self._take_down("closes")

    def _take_down(self, line: str) -> None:
        self.log.append(f"{self._name} {line}")
        if self._name in self.fails and "begins" not in line:
            raise OSError(28, "No space left on device")


@pytest.fixture
def recording(monkeypatch: pytest.MonkeyPatch) -> type[Recording]:
    for name in LOGGERS:
        monkeypatch.setitem(LOGGERS, name, lambda settings, name=name: Recording(name))
    monkeypatch.setattr(Recording, "log", [])
    return Recording


SWEEP = ("lam=0,0.4", "num_seeds=2", "hydra.launcher.pictures_up_to=0", *QUICK)


def test_each_job_of_a_batch_is_logged_and_then_the_sweep(
    recording: type[Recording], tmp_path: Path
) -> None:
    sweep = tmp_path / "sweep"
    command = (*SWEEP, "logger=[wandb,mlflow]", f"hydra.sweep.dir={sweep}", "-m")
    assert fnnq_train(*command) == 0
    of_each = ["begins 2", "sweep/0 of sweep: 2 runs", "sweep/1 of sweep: 2 runs"]
    of_each += ["sweep: 2 jobs, ['learning_curves.png']", "closes"]
    assert recording.log == [f"{name} {line}" for line in of_each for name in ("wandb", "mlflow")]

    # With other loggers it is the same finished sweep, so there is nothing new to log.
    recording.log.clear()
    assert fnnq_train(*SWEEP, "logger=mlflow", f"hydra.sweep.dir={sweep}", "-m") == 0
    assert recording.log == []


def test_a_logger_that_fails_is_told_of_once_and_left_out(
    recording: type[Recording],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(recording, "fails", ("wandb",))
    command = (*SWEEP, "logger=[wandb,mlflow]", f"hydra.sweep.dir={tmp_path}", "-m")
    assert fnnq_train(*command) == 0
    assert sum(line.startswith("mlflow") for line in recording.log) == 5
    assert sum(line.startswith("wandb") for line in recording.log) == 3
    told = [line for line in capfd.readouterr().err.splitlines() if "going on without" in line]
    assert told == ["going on without wandb, which has failed: [Errno 28] No space left on device"]
    for job in ("0", "1"):
        assert all((tmp_path / job / name).exists() for name in FILES if "curve" not in name)


def test_a_sweep_of_several_launches_is_logged_once(
    recording: type[Recording], tmp_path: Path
) -> None:
    sweep = (f"hydra.sweep.dir={tmp_path / 'sweep'}", "hydra.sweeper.max_batch_size=1", "-m")
    assert fnnq_train(*SWEEP, "logger=mlflow", *sweep) == 0
    of_each = [line for job in (0, 1) for line in ("begins 1", f"sweep/{job} of sweep: 2 runs")]
    of_each += ["sweep: 2 jobs, ['learning_curves.png']", "closes"]
    assert recording.log == [f"mlflow {line}" for line in of_each]


def test_a_logger_that_cant_begin_is_left_out(
    recording: type[Recording],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def fail(self: Recording, name: str) -> None:
        raise RuntimeError("its service\ndoesn't start")

    monkeypatch.setattr(recording, "__init__", fail)
    assert fnnq_train(*QUICK, "logger=mlflow", f"hydra.run.dir={tmp_path}") == 0
    told = [line for line in capfd.readouterr().err.splitlines() if "going on without" in line]
    assert told == ["going on without mlflow, which has failed: its service doesn't start"]
    assert (tmp_path / "summary.json").exists()


def test_a_job_draws_a_video_for_its_loggers(
    recording: type[Recording], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The video shows three of the test's situations side by side."""
    monkeypatch.setattr(drawing, "_FRAMES", 4)
    monkeypatch.setattr(drawing, "_PANEL_PX", 60)
    command = (*QUICK, "logger=mlflow", "logger.video=true", f"hydra.run.dir={tmp_path}")
    assert fnnq_train(*command) == 0
    assert recording.log[1] == f"mlflow {tmp_path.name} of {tmp_path.name}: 1 runs, robot.gif"
    with Image.open(tmp_path / "robot.gif") as video:
        assert 3 <= video.n_frames <= 5
        assert video.width == 180


def test_a_video_that_cant_be_drawn_is_one_line(
    recording: type[Recording],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def fail(*arguments: object, **settings: object) -> None:
        raise RuntimeError("no\nfont")

    monkeypatch.setattr(watching, "write_gif", fail)
    command = (*QUICK, "logger=mlflow", "logger.video=true", f"hydra.run.dir={tmp_path}")
    assert fnnq_train(*command) == 0
    video = tmp_path / "robot.gif"
    told = [line for line in capfd.readouterr().err.splitlines() if "going on without" in line]
    assert told == [f"going on without {video}, which can't be drawn: no font"]
    assert recording.log[1] == f"mlflow {tmp_path.name} of {tmp_path.name}: 1 runs"
    assert not video.exists()
    assert (tmp_path / "summary.json").exists()


def test_results_are_the_same_whoever_logs_them(
    recording: type[Recording], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(recording, "fails", ("mlflow",))
    for name, choice in {"without": "csv", "with": "[wandb,mlflow]"}.items():
        arguments = (f"logger={choice}", f"hydra.run.dir={tmp_path / name}")
        assert fnnq_train(*QUICK, "num_seeds=2", *arguments) == 0
    assert len(recording.log) == 6
    for file in FILES[:3]:
        one, other = ((tmp_path / name / file).read_bytes() for name in ("without", "with"))
        assert one == other


@pytest.mark.parametrize("name", ["wandb", "tensorboard", "mlflow"])
def test_a_missing_library_is_one_line_before_training(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, f"fnnq_torchrl.training.loggers.{name}", None)
    assert fnnq_train(*QUICK, f"logger=[csv,{name}]", f"hydra.run.dir={tmp_path}") == 2
    assert capfd.readouterr().err == (
        f"logger={name}: needs a library that isn't installed; {installing(name)}\n"
    )
    assert not (tmp_path / "evaluations.csv").exists()


def test_who_chooses_no_logger_needs_no_library(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("wandb", "tensorboard", "mlflow"):
        monkeypatch.setitem(sys.modules, f"fnnq_torchrl.training.loggers.{name}", None)
    Loggers().prepare([Job(load_config(), tmp_path)])


def test_csv_has_nothing_to_set_and_is_always_there() -> None:
    assert not load_config().logger.video
    assert load_config("logger=[]") == load_config("logger=csv") == load_config()
    with pytest.raises(ConfigError, match=r"there is no logger\.csv"):
        load_config("logger.csv.every=1")
