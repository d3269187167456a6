"""Programs are built once, and kept."""

import ctypes
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch

from fnnq_torchrl.config import ConfigError
from fnnq_torchrl.native import build as building
from fnnq_torchrl.native import cache_directory
from fnnq_torchrl.native.build import build, compiler_found

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
    with pytest.raises(ConfigError, match=r"^engine=compiled: .*nonsense"):
        build("nonsense")
    assert [*empty_cache.iterdir()] == []


@pytest.mark.parametrize("xdg", [True, False])
def test_programs_are_kept_where_the_user_keeps_caches(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, xdg: bool
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg") if xdg else "")
    assert cache_directory() == tmp_path / ("xdg" if xdg else ".cache") / "fnnq_torchrl"


def test_the_compiler_is_the_systems_or_the_one_that_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CXX", str(tmp_path / "my-own"))
    assert not compiler_found()
    (tmp_path / "my-own").touch(mode=0o755)
    assert compiler_found()
