"""A disk that is full, and one that is read-only: real ones, where the tests may mount any."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from fnnq_torchrl.compose import load_config
from fnnq_torchrl.job import run_job
from fnnq_torchrl.saved import SavedTraining
from fnnq_torchrl.trainer import Trainer

from .commands import fnnq_train

TINY = ("situations=5", "env.time_limit_steps=4", "engine=eager", "checkpoint.every_s=1e-9")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 KiB, on which a training has been saved."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("needs the right to mount")
    try:
        config = load_config(*TINY)
        trainer = Trainer(config)
        SavedTraining(place, config, trainer.engine.name).save(trainer.ledger, [])
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


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
    assert told.startswith("going on, but this training can't be saved, for now: ")
    assert str(disk / "training.pt") in told


def test_a_command_on_a_full_disk_ends_in_one_line(
    disk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The log and the configuration are Hydra's, and small.
    quiet = ("hydra/job_logging=none", "hydra/hydra_logging=none", "hydra.output_subdir=null")
    before = (disk / "training.pt").read_bytes()
    fill(disk)
    assert fnnq_train(*TINY, *quiet, f"hydra.run.dir={disk}") == 1
    stderr = capsys.readouterr().err
    assert "Traceback" not in stderr
    assert stderr.splitlines()[-1] == f"{disk / 'checkpoint.pt'}: No space left on device"
    assert (disk / "training.pt").read_bytes() == before
