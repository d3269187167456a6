import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from fnnq_torchrl.files.atomic import alone_in, atomic_write, clear_leftovers


def contents(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}


def write_half(path: Path) -> None:
    with atomic_write(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt


def test_the_new_file_replaces_the_old_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "result"
    path.write_bytes(b"old")
    with atomic_write(path) as file:
        file.write(b"new")
    assert contents(tmp_path) == {"result": b"new"}


def test_a_reader_sees_the_old_file_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "result"
    path.write_bytes(b"old")
    with atomic_write(path) as file:
        file.write(b"half")
        file.flush()
        assert path.read_bytes() == b"old"


def test_an_interrupted_block_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "result"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt):
        write_half(path)
    assert contents(tmp_path) == {"result": b"old"}


def test_a_full_disk_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    path = tmp_path / "result"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as told, atomic_write(path) as file:
        file.write(b"new")
    assert told.value.filename == str(path)
    assert contents(tmp_path) == {"result": b"old"}


def test_all_bytes_are_on_disk_before_the_name_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result"
    synced_sizes = []

    def fsync(descriptor: int) -> None:
        assert not path.exists()
        synced_sizes.append(os.fstat(descriptor).st_size)

    monkeypatch.setattr(os, "fsync", fsync)
    with atomic_write(path) as file:
        file.write(b"new")
    assert synced_sizes == [3]


def test_a_killed_process_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "result"
    path.write_bytes(b"old")
    script = (
        "import os, pathlib, signal, sys\n"
        "from fnnq_torchrl.files.atomic import atomic_write\n"
        "with atomic_write(pathlib.Path(sys.argv[1])) as file:\n"
        "    file.write(b'half')\n"
        "    file.flush()\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(path)], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"
    [leftover] = [left for left in tmp_path.iterdir() if left != path]
    assert leftover.suffix == ".tmp"
    clear_leftovers(tmp_path)
    assert contents(tmp_path) == {"result": b"old"}


def test_what_is_not_ours_is_no_leftover(tmp_path: Path) -> None:
    (tmp_path / ".notes.tmp").write_bytes(b"mine")
    clear_leftovers(tmp_path)
    assert contents(tmp_path) == {".notes.tmp": b"mine"}


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600)])
def test_permissions_follow_the_umask(tmp_path: Path, umask: int, mode: int) -> None:
    path = tmp_path / "result"
    before = os.umask(umask)
    try:
        with atomic_write(path) as file:
            file.write(b"new")
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == mode


def test_a_missing_directory_is_the_usual_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "missing" / "result"):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="needs locks of directories")
def test_no_two_processes_are_alone_in_a_directory(tmp_path: Path) -> None:
    from fcntl import LOCK_EX, LOCK_NB, flock

    other = os.open(tmp_path, os.O_RDONLY)
    with alone_in(tmp_path), pytest.raises(BlockingIOError):
        flock(other, LOCK_EX | LOCK_NB)
    flock(other, LOCK_EX | LOCK_NB)
    os.close(other)
