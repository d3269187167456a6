"""A step with a known recipe isn't traced again; what could be another program is."""

import ctypes
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fnnq_torchrl.engine.native import build as building
from fnnq_torchrl.engine.native import known
from fnnq_torchrl.engine.native.build import Run
from fnnq_torchrl.engine.native.known import program

pytestmark = pytest.mark.usefixtures("compiler")

SET = """
#include <cstdint>
extern "C" void run(int64_t lanes, int64_t steps, void* const* leaf) {
    static_cast<int64_t*>(leaf[0])[0] = %d;
}
"""


def number(run: Run) -> int:
    n = torch.zeros(1, dtype=torch.int64)
    run(1, 1, (ctypes.c_void_p * 1)(n.data_ptr()))
    return int(n)


class Step:
    """A step whose program sets a number; it counts how often it is traced."""

    def __init__(self, number: int) -> None:
        self.number, self.traced = number, 0

    def text(self) -> str:
        self.traced += 1
        return SET % self.number


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "fnnq_torchrl"


def test_a_known_step_is_not_traced(cache: Path) -> None:
    step = Step(1)
    assert [number(program("one", step.text)) for _ in range(3)] == [1] * 3
    assert step.traced == 1


def test_a_step_without_a_recipe_is_always_traced(cache: Path) -> None:
    step = Step(2)
    assert [number(program(None, step.text)) for _ in range(2)] == [2] * 2
    assert step.traced == 2
    assert not (cache / "steps").exists()


def other_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "_target", lambda compiler: "another compiler or processor")


def other_flags(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "_FLAGS", building._FLAGS + " -DOTHER")


def other_dtype(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "get_default_dtype", lambda: torch.float64)


def other_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.backends.cpu, "get_cpu_capability", lambda: "DEFAULT")


def other_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version", "4.0")


def other_release(library: str) -> Callable[[pytest.MonkeyPatch], None]:
    def change(monkeypatch: pytest.MonkeyPatch) -> None:
        of = known.version
        monkeypatch.setattr(known, "version", lambda name: of(name) + "x" * (name == library))

    return change


CHANGES = {
    "compiler": other_compiler,
    "flags": other_flags,
    "dtype": other_dtype,
    "kernels": other_kernels,
    "python": other_python,
} | {name: other_release(name) for name in ("torch", "tensordict", "torchrl", "numpy")}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_change_around_the_step_traces_it_again(
    cache: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[pytest.MonkeyPatch], None],
) -> None:
    step = Step(3)
    program("it", step.text)
    change(monkeypatch)
    program("it", step.text)
    assert step.traced == 2


@pytest.mark.parametrize("package", ["envs", "fnnq_torchrl"])
@pytest.mark.parametrize("change", ["edit", "add", "rename"])
def test_a_change_of_our_sources_traces_the_step_again(
    cache: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, package: str, change: str
) -> None:
    roots = [tmp_path / "sources" / root.name for root in known._PACKAGES]
    assert [root.name for root in roots] == ["envs", "fnnq_torchrl"]
    for root in roots:
        (root / "core").mkdir(parents=True)
        (root / "core" / "old.py").write_text("a = 1\n")
    monkeypatch.setattr(known, "_PACKAGES", roots)
    step = Step(4)
    program("it", step.text)
    module = tmp_path / "sources" / package / "core" / "old.py"
    if change == "edit":
        kept = module.stat()
        module.write_text("a = 2\n")
        os.utime(module, ns=(kept.st_atime_ns, kept.st_mtime_ns))  # the content counts
    elif change == "add":
        module.with_name("new.py").touch()
    else:
        module.rename(module.with_name("new.py"))
    known._sources.cache_clear()
    program("it", step.text)
    known._sources.cache_clear()
    assert step.traced == 2


def only(directory: Path) -> Path:
    (path,) = directory.iterdir()
    return path


def replaced(path: Path, content: bytes) -> None:
    path.unlink()  # a library that is loaded must not change
    path.write_bytes(content)


@given(st.binary(max_size=40))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_note_is_as_good_as_none(cache: Path, content: bytes) -> None:
    step = Step(5)
    program("it", step.text)
    replaced(only(cache / "steps"), content)
    assert number(program("it", step.text)) == 5
    before = step.traced
    assert number(program("it", step.text)) == 5
    assert step.traced == before  # the note is whole again


@pytest.mark.parametrize("damage", ["bit", "cut", "gone", "another program"])
def test_a_damaged_library_is_not_loaded(cache: Path, tmp_path: Path, damage: str) -> None:
    """One flipped bit could be an instruction that computes something else."""
    step = Step(6)
    program("it", step.text)
    library = only(cache / "native")
    content = library.read_bytes()
    if damage == "bit":
        replaced(library, bytes([*content[:-9], content[-9] ^ 1, *content[-8:]]))
    elif damage == "cut":
        replaced(library, content[: len(content) // 2])
    elif damage == "gone":
        library.unlink()
    else:
        program("other", Step(7).text)
        other = next(path for path in (cache / "native").iterdir() if path != library)
        replaced(library, other.read_bytes())
    assert number(program("it", step.text)) == 6
    assert step.traced == 2


def test_a_note_leads_only_to_the_libraries(cache: Path, tmp_path: Path) -> None:
    step = Step(8)
    program("it", step.text)
    other = building.library_of(SET % 9)
    building.build(SET % 9)
    outside = tmp_path / "outside.so"
    outside.write_bytes(other.read_bytes())
    replaced(
        only(cache / "steps"),
        f"../../outside.so {known._content(outside)}".encode(),
    )
    assert number(program("it", step.text)) == 8


def test_where_no_note_can_be_written_the_step_runs(cache: Path) -> None:
    (cache / "steps").parent.mkdir(parents=True)
    (cache / "steps").touch()
    assert number(program("it", Step(10).text)) == 10
