"""The choice of the engine that runs a job, and the messages about it."""

import errno
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch._inductor.runtime.cache_dir_utils import default_cache_dir

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.engine.choice import choose_engine, make_engine
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import EagerLoop
from fnnq_torchrl.engine.native import build, cache_directory
from tests.compositions import config_of

CPU = torch.device("cpu")
LITTLE, MUCH = config_of("situations=5"), config_of("situations=10000")


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Return a function that installs a program on a search path that is empty at first."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    build._target.cache_clear()

    def install(name: str) -> Path:
        path = tmp_path / name
        path.write_text("#!/bin/sh\n")
        path.chmod(0o755)
        return path

    return install


def test_auto_is_by_the_work_ahead(install: Callable[[str], Path]) -> None:
    install("g++")
    for config, expected, why in (
        (LITTLE, "eager", "not worth compiling"),
        (MUCH, "compiled", "worth it"),
    ):
        engine = choose_engine(config, 1)
        line = engine.why
        assert engine.name == expected
        assert line.startswith(f"engine: {expected}, since about ")
        assert why in line
        assert "\n" not in line


def test_more_work_never_makes_it_eager_again(install: Callable[[str], Path]) -> None:
    install("g++")
    names = [choose_engine(replace(LITTLE, situations=5 * 2**n), 1).name for n in range(12)]
    assert names == sorted(names, reverse=True)  # first eager, then compiled
    assert set(names) == {"eager", "compiled"}
    # Runs take their steps side by side, so 1,000 runs take little longer than one.
    assert choose_engine(LITTLE, 1000).name == "eager"


def test_without_a_compiler_auto_is_eager_and_says_why(install: Callable[[str], Path]) -> None:
    engine = choose_engine(MUCH, 1)
    assert engine.name == "eager"
    assert engine.why.startswith("engine: eager, since there is no C++ compiler ")


@pytest.mark.parametrize("engine", ["eager", "compiled"])
@pytest.mark.parametrize("job", [LITTLE, MUCH], ids=["little", "much"])
def test_what_is_asked_for_is_what_there_is(install, job, engine: str) -> None:
    install("g++")
    chosen = choose_engine(replace(job, engine=engine), 1)
    assert (chosen.name, chosen.why) == (engine, f"engine: {engine}, as asked for")


def test_a_compiler_that_fails_is_as_good_as_none(install: Callable[[str], Path]) -> None:
    install("g++").write_text("#!/bin/sh\nexit 1\n")
    engine = choose_engine(MUCH, 1)
    assert engine.name == "eager"
    assert engine.why.startswith("engine: eager, since the C++ compiler g++ doesn't work")


def test_with_nowhere_to_put_programs_auto_is_eager_and_says_why(
    install: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install("g++")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "g++"))  # a file
    monkeypatch.setattr(build, "_check_room", full)
    engine = choose_engine(MUCH, 1)
    assert engine.name == "eager"
    assert engine.why.startswith("engine: eager, since no directory for programs: ")
    assert "No space left on device" in engine.why


def full(directory: Path) -> None:
    raise OSError(errno.ENOSPC, "No space left on device", str(directory))


@pytest.mark.usefixtures("install")
def test_compiling_without_a_compiler_is_refused_in_one_line() -> None:
    with pytest.raises(ConfigError, match=r"^engine=compiled: .*C\+\+ compiler.*engine=eager "):
        make_engine("compiled", CPU)
    with pytest.raises(ConfigError) as refused:
        choose_engine(replace(LITTLE, engine="compiled"), 1)
    assert len(str(refused.value).splitlines()) == 1


def counting(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    return TensorDict({"n": state["n"] + stays["by"]}, state.batch_size)


@pytest.mark.parametrize("steps", [0, 1, 7])
def test_the_eager_loop_is_so_many_steps(steps: int) -> None:
    stays = TensorDict({"by": torch.tensor([[1], [2], [3]])}, [3])
    state = TensorDict({"n": torch.zeros(3, 1, dtype=torch.int64)}, [3])
    running = EagerLoop(lambda lanes: counting, stays, state)(stays, state)
    running.advance(steps)
    assert running.state["n"].flatten().tolist() == [steps, 2 * steps, 3 * steps]
    assert (state["n"] == 0).all()


@pytest.fixture
def four_threads() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(4)
    yield
    torch.set_num_threads(before)


@pytest.mark.usefixtures("four_threads", "install")
def test_the_threads_are_torchs_or_the_workers(install: Callable[[str], Path]) -> None:
    """With four workers, each operation has one thread, so that they share the cores."""
    install("g++")
    eager, compiled = make_engine("eager", CPU), make_engine("compiled", CPU)
    assert (eager.workers, compiled.workers) == (1, 4)
    for engine, small, large in ((eager, 1, 4), (compiled, 1, 1)):
        for elements, threads in ((100, small), (2**20, large)):
            with engine.threads(elements):
                assert torch.get_num_threads() == threads
        assert torch.get_num_threads() == 4


def test_inductor_keeps_its_programs_there_too_unless_the_user_says_where(
    install: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("fnnq_torchrl.engine.inductor.InductorLoop", lambda *args: args)
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", default_cache_dir())  # as importing torch sets it
    install("g++")
    make_loop = make_engine("compiled", torch.device("cuda")).make_loop
    make_loop(counting, *[TensorDict({}, [LANES])] * 2)
    capability = torch.backends.cpu.get_cpu_capability()
    own = cache_directory() / "inductor" / capability
    assert os.environ["TORCHINDUCTOR_CACHE_DIR"] == str(own)
    monkeypatch.setenv("TORCHINDUCTOR_CACHE_DIR", str(tmp_path / "mine"))
    make_loop(counting, *[TensorDict({}, [LANES])] * 2)
    assert os.environ["TORCHINDUCTOR_CACHE_DIR"] == str(tmp_path / "mine")
