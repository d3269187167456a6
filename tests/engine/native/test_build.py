"""Native programs are built once and kept in a cache."""

import ctypes
import os
import re
import stat
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from fnnq_torchrl.engine.native import build as building
from fnnq_torchrl.engine.native import cache_directory
from fnnq_torchrl.engine.native.build import CannotCompile, build, check_compiler
from tests.disks import mounted

pytestmark = pytest.mark.usefixtures("compiler")

ADD = """
#include <cstdint>
extern "C" void run(int64_t lanes, int64_t steps, void* const* leaf) {
    static_cast<int64_t*>(leaf[0])[0] += 100 * lanes + steps + %d;
}
"""


def call(run, lanes: int, steps: int) -> int:
    n = torch.zeros(1, dtype=torch.int64)
    run(lanes, steps, (ctypes.c_void_p * 1)(n.data_ptr()))
    return n.item()


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "fnnq_torchrl" / "native"


def test_a_program_is_run(empty_cache: Path) -> None:
    assert call(build(ADD % 0), 7, 3) == 703


def test_a_program_is_compiled_once(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build(ADD % 1)
    (kept,) = empty_cache.iterdir()
    monkeypatch.setattr(building, "_compile", lambda *_: pytest.fail("compiled again"))
    assert call(build(ADD % 1), 1, 0) == 101
    assert [*empty_cache.iterdir()] == [kept]


def test_another_program_flag_or_machine_is_another(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call(build(ADD % 2), 0, 0) == 2
    assert call(build(ADD % 3), 0, 0) == 3
    monkeypatch.setattr(building, "_FLAGS", building._FLAGS + " -DOTHER")
    assert call(build(ADD % 3), 0, 0) == 3
    monkeypatch.setattr(building, "_target", lambda compiler: "another processor")
    assert call(build(ADD % 3), 0, 0) == 3
    assert len([*empty_cache.iterdir()]) == 4


def test_jobs_that_build_the_same_at_once_leave_one_whole_file(empty_cache: Path) -> None:
    with ThreadPoolExecutor(4) as pool:
        runs = [*pool.map(build, [ADD % 4] * 4)]
    assert [call(run, 0, 1) for run in runs] == [5] * 4
    assert len([*empty_cache.iterdir()]) == 1


def test_a_program_that_does_not_compile_leaves_nothing(empty_cache: Path) -> None:
    with pytest.raises(CannotCompile, match=r"^engine=compiled: .*nonsense"):
        build("nonsense")
    assert [*empty_cache.iterdir()] == []


@pytest.mark.parametrize("xdg", ["an absolute path", "relative", ""])
def test_programs_are_kept_where_the_user_keeps_caches(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, xdg: str
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg") if "absolute" in xdg else xdg)
    building._usable.cache_clear()
    home = tmp_path / ("xdg" if "absolute" in xdg else ".cache")
    assert cache_directory() == home / "fnnq_torchrl"
    assert stat.S_IMODE(cache_directory().stat().st_mode) == 0o700  # its files are executed


def test_where_nothing_can_be_kept_it_is_made_for_this_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with caplog.at_level("INFO"):
        assert call(build(ADD % 6), 0, 0) == 6
    assert not str(cache_directory()).startswith(str(tmp_path))
    (record,) = caplog.records
    assert "XDG_CACHE_HOME" in record.message


@pytest.mark.skipif(sys.platform == "win32", reason="needs permissions")
def test_programs_that_others_may_write_are_not_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "fnnq_torchrl").mkdir()
    (tmp_path / "fnnq_torchrl").chmod(0o777)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with caplog.at_level("INFO"):
        assert tmp_path not in cache_directory().parents
    assert "other users can write there" in caplog.text


@pytest.mark.parametrize("damage", [b"", b"no program"])
def test_a_damaged_program_is_made_again(empty_cache: Path, damage: bytes) -> None:
    build(ADD % 7)
    (kept,) = empty_cache.iterdir()
    kept.unlink()  # a file that is loaded must not change
    kept.write_bytes(damage)
    assert call(build(ADD % 7), 1, 0) == 107


def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Put a shell script in the compiler's place."""
    program = tmp_path / "my own compiler"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("CXX", f"'{program}' -O0")
    building._target.cache_clear()


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("echo nothing >&2; echo fatal error: no headers >&2; exit 1", "fatal error: no headers"),
        ("exit 3", "nothing, with exit status 3"),
        ("kill -9 $$", "nothing, it was ended by SIGKILL"),
    ],
)
def test_a_compiler_that_fails_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, says: str
) -> None:
    fake(tmp_path, monkeypatch, script)
    with pytest.raises(CannotCompile, match=f"^engine=compiled: .*{says}; engine=eager"):
        check_compiler()
    with pytest.raises(CannotCompile, match=f"^engine=compiled: .*{says}; engine=eager"):
        build(ADD % 8)


def test_the_compiler_is_the_systems_or_the_one_that_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for command in (str(tmp_path / "nobody"), "'", " "):
        monkeypatch.setenv("CXX", command)
        with pytest.raises(CannotCompile, match=re.escape(command)):
            check_compiler()
    fake(tmp_path, monkeypatch, "test $1 = -O0")
    check_compiler()


def test_ctrl_c_is_not_for_the_compiler(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ours = f"import os; assert os.getsid(0) != {os.getsid(0)}"
    fake(tmp_path, monkeypatch, f"'{sys.executable}' -c '{ours}'")
    check_compiler()


@pytest.mark.parametrize(
    ("options", "says"),
    [("noexec", "noexec"), ("size=1m", "No space left on device"), ("ro", "Read-only")],
)
def test_a_cache_that_cannot_keep_programs_is_found_out_before(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    options: str,
    says: str,
) -> None:
    with mounted(tmp_path / "disk", options) as disk:
        monkeypatch.setenv("XDG_CACHE_HOME", str(disk))
        with caplog.at_level("INFO"):
            assert call(build(ADD % 9), 0, 0) == 9
        (record,) = caplog.records
        assert says in record.message
        monkeypatch.setattr(building, "_for_this_process", lambda: SimpleNamespace(name=str(disk)))
        building._usable.cache_clear()
        with pytest.raises(CannotCompile, match=f"^engine=compiled: no directory.*{says}"):
            check_compiler()


def test_a_disk_that_becomes_full_is_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The linker itself gives only its exit status."""
    with mounted(tmp_path / "disk", "size=8k") as disk:
        monkeypatch.setattr(building, "cache_directory", lambda: disk)
        with pytest.raises(CannotCompile, match="No space left on device"):
            build(ADD % 10)
