"""Settings of torch and hypothesis, and fixtures, for all tests."""

import gc
import os
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

# The tensors are small, so a second thread is no help: on a busy machine it costs milliseconds for
# each operation. Torch reads the variable at its import; the commands under test inherit it.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from fnnq_torchrl.studies.experiments import Experiment

# The first call of a torch operation can take seconds, so no example has a deadline.
settings.register_profile(
    "here", max_examples=50, deadline=None, derandomize="CI" in os.environ, print_blob=True
)
settings.register_profile("long", settings.get_profile("here"), max_examples=5000)  # make fuzz
settings.load_profile("here")


# What the imports make is no garbage: looking through it again and again would take a quarter of
# the time of the imports and a fifth of that of the tests.
gc.disable()


def pytest_collection_finish() -> None:
    """Collect garbage from now on, but not among what the imports have made."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep compiled programs in a cache that the workers of this test session share."""
    session = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        session = session.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(session / "cache"))
        patch.setenv("TORCHINDUCTOR_CACHE_DIR", str(session / "cache" / "inductor"))
        yield


@pytest.fixture(scope="session", autouse=True)
def blank_curves() -> Iterator[None]:
    """Leave blank pictures as learning curves: drawing one takes longer than most jobs here.

    ``tests/training/test_drawing.py`` and ``tests/studies/test_figures.py`` draw.
    """
    from PIL import Image

    from fnnq_torchrl.files.atomic import atomic_write

    def blank(picture: Path) -> None:
        with atomic_write(picture) as file:
            Image.new("RGB", (8, 6), "white").save(file, "PNG")

    curves = "fnnq_torchrl.training.pictures.curves"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"{curves}.learning_curve", lambda evaluations, to, score: blank(to))
        patch.setattr(f"{curves}.sweep_curves", lambda curves, of, to, score: blank(to))
        yield


@pytest.fixture
def usual_signals() -> Iterator[None]:
    """Set signals as a process in a terminal has them, and restore them afterwards."""
    usual = {"SIGINT": signal.default_int_handler}
    names = [
        name
        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2")
        if hasattr(signal, name)
    ]
    before = {
        name: signal.signal(getattr(signal, name), usual.get(name, signal.SIG_DFL))
        for name in names
    }
    yield
    for name, answer in before.items():
        signal.signal(getattr(signal, name), answer)


@pytest.fixture(scope="session")
def compiler() -> None:
    """Skip the test if there is no C++ compiler."""
    from fnnq_torchrl.engine.native import CannotCompile, check_compiler

    try:
        check_compiler()
    except CannotCompile as error:
        pytest.skip(error.reason)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch 2.13 uses functions that it has deprecated
        import torch._inductor.compile_fx  # noqa: F401


@pytest.fixture(scope="session", autouse=True)
def no_fsync() -> Iterator[None]:
    """Don't wait for the disk: no test is about a power failure."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda file: None)
        yield


@pytest.fixture(scope="session")
def experiments(tmp_path_factory: pytest.TempPathFactory) -> "dict[str, Experiment]":
    """Invent results of all experiments: 110 runs of the large ones, 12 of the others."""
    from .experiment_files import EXPERIMENTS, invent_experiment, paper_level
    from .small_world_files import invent_small_worlds

    invented = {
        name: invent_experiment(name, jobs, paper_level, 110 if name.endswith("large") else 12)
        for name, jobs in EXPERIMENTS.items()
    }
    return invented | invent_small_worlds(tmp_path_factory.mktemp("small worlds"))
