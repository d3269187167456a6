"""Training on a full disk and on a read-only disk. The tests mount both if they are allowed to."""

import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.trainer import Trainer
from tests.commands import fnnq_train
from tests.compositions import config_of
from tests.disks import mounted
from tests.programs import saved_training

TINY = ("situations=5", "env.time_limit_steps=4", "engine=eager", "checkpoint.every_s=1e-9")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a disk of 64 KiB that has a saved training."""
    with mounted(tmp_path / "disk", "size=64k") as place:
        config = config_of(*TINY)
        trainer = Trainer.of(config)
        saved_training(place, config).save(trainer.ledger, [])
        yield place


def fill(disk: Path) -> None:
    try:
        with open(disk / "filler", "wb", buffering=0) as file:
            while True:
                file.write(bytes(256))
    except OSError:
        return


def make_read_only(disk: Path) -> None:
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)


@pytest.mark.parametrize(
    ("break_it", "why"),
    [(fill, "No space left on device"), (make_read_only, "Read-only file system")],
    ids=["full", "read-only"],
)
def test_the_last_good_checkpoint_stays(
    disk: Path, capsys: pytest.CaptureFixture[str], break_it, why: str
) -> None:
    break_it(disk)
    before = {path.name: path.read_bytes() for path in disk.iterdir()}
    with pytest.raises(OSError, match=why) as ended:
        run_job(load_config(*TINY), disk)
    assert Path(ended.value.filename).parent == disk
    assert {path.name: path.read_bytes() for path in disk.iterdir()} == before
    [told] = [line for line in capsys.readouterr().err.splitlines() if why in line]
    assert "going on, but this training can't be saved, for now: " in told
    assert str(disk / "training.pt") in told


def test_a_file_that_grows_too_large_leaves_the_last_good_checkpoint(tmp_path: Path) -> None:
    """A limit on file sizes stands for a full disk, so the test needs no right to mount."""
    config = config_of(*TINY)
    trainer = Trainer.of(config)
    saved_training(tmp_path, config).save(trainer.ledger, [])
    before = (tmp_path / "training.pt").read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) // 2, hard))
    try:
        with pytest.raises(OSError, match="File too large"):
            run_job(config, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"training.pt": before}


@pytest.mark.parametrize("sweep", [False, True])
def test_a_command_that_cant_even_begin_ends_in_one_line(disk: Path, sweep: bool) -> None:
    """Hydra's own files are the first files that can't be written."""
    fill(disk)
    place = f"hydra.sweep.dir={disk}/sweep" if sweep else f"hydra.run.dir={disk}"
    command = [sys.executable, "-m", "fnnq_torchrl.train", *TINY, place, *["-m"] * sweep]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 1
    [line] = ended.stderr.splitlines()
    assert line.endswith("No space left on device")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux")
@pytest.mark.long
def test_a_log_that_is_full_ends_nothing(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "fnnq_torchrl.train", *TINY, f"hydra.run.dir={tmp_path}"]
    with open("/dev/full", "w") as full:
        ended = subprocess.run(command, stderr=full, stdout=subprocess.DEVNULL)
        assert ended.returncode == 0
        assert (tmp_path / "summary.json").exists()
        (tmp_path / "summary.json").unlink()
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.stderr.splitlines()[-1] == "standard output: No space left on device"
    assert ended.returncode == 1
    assert (tmp_path / "summary.json").exists()


def test_a_command_on_a_full_disk_ends_in_one_line(
    disk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Without Hydra's log and configuration, which are small.
    quiet = ("hydra/job_logging=none", "hydra/hydra_logging=none", "hydra.output_subdir=null")
    before = (disk / "training.pt").read_bytes()
    fill(disk)
    assert fnnq_train(*TINY, *quiet, f"hydra.run.dir={disk}") == 1
    stderr = capsys.readouterr().err
    assert "Traceback" not in stderr
    assert stderr.splitlines()[-1] == f"{disk / 'checkpoint.pt'}: No space left on device"
    assert (disk / "training.pt").read_bytes() == before
