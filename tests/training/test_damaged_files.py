"""A damaged file is refused in one line that names the file, or is read as if it were undamaged."""

import shutil
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from fnnq_torchrl.launch import command as cli  # noqa: F401  # with the resolvers that commands have
from fnnq_torchrl.studies.experiments import read_experiment
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations, read_summary
from fnnq_torchrl.training.trainer import Trainer
from fnnq_torchrl.training.weights import load_checkpoint
from tests.programs import config, saved_training

JOB = config("situations=5", "engine=eager", "num_seeds=2", "env.time_limit_steps=4")
TRAINING, CHECKPOINT = "training.pt", "checkpoint.pt"
CONFIG = ".hydra/config.yaml"


class Home(NamedTuple):
    """A finished job's directory, and a directory for damaged copies of its files."""

    files: Path
    damaged: Path


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Home:
    root = tmp_path_factory.mktemp("sweep")
    job = root / "0"
    (job / ".hydra").mkdir(parents=True)
    run_job(JOB, job)
    (job / CONFIG).write_text(OmegaConf.to_yaml(OmegaConf.create(asdict(JOB))))
    trainer = Trainer.of(JOB)
    trainer.learn()
    saved_training(job, JOB).save(trainer.ledger, [])
    damaged = tmp_path_factory.mktemp("damaged")
    shutil.copytree(job, damaged / "0")
    return Home(job, damaged / "0")


def load_training(path: Path) -> object:
    trainer = Trainer.of(JOB)
    saved = saved_training(path.parent, JOB)
    saved.read()
    saved.restore(trainer.ledger)
    return trainer.ledger.state_dict() | {"seconds": None}


def read_config(path: Path) -> object:
    [job] = read_experiment(path.parents[2], "sweep").jobs
    return job.settings


READERS: dict[str, Callable[[Path], Any]] = {
    TRAINING: load_training,
    CHECKPOINT: lambda path: vars(load_checkpoint(path)),
    "summary.json": read_summary,
    "evaluations.csv": lambda path: vars(read_evaluations(path)),
    CONFIG: read_config,
}


def same(one: Any, other: Any) -> bool:
    if isinstance(one, torch.Tensor):
        return torch.equal(one, other)
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    return bool(one == other)


def assert_read_or_refused(home: Home, name: str, data: bytes) -> None:
    """Check that a damaged file is refused, or read; binary files must have their content."""
    path = home.damaged / name
    path.write_bytes(data)
    found, refused = read(home, name)
    if refused is None and path.suffix == ".pt":
        assert same(found, READERS[name](home.files / name))


def read(home: Home, name: str) -> tuple[Any, str | None]:
    """Return the damaged file's content, or the message that refuses it; then restore the file."""
    path = home.damaged / name
    try:
        return READERS[name](path), None
    except ValueError as error:  # ConfigError is a ValueError
        refused = str(error)
    finally:
        shutil.copy(home.files / name, path)
    assert len(refused.splitlines()) == 1
    assert str(path) in refused
    return None, refused


FUZZED = settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
@FUZZED
def test_a_truncated_file(home: Home, name: str, data: st.DataObject) -> None:
    whole = (home.files / name).read_bytes()
    assert_read_or_refused(home, name, whole[: data.draw(st.integers(0, len(whole) - 1))])


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
@FUZZED
def test_a_file_with_other_bytes_in_it(home: Home, name: str, data: st.DataObject) -> None:
    whole = bytearray((home.files / name).read_bytes())
    places = st.tuples(st.integers(0, len(whole) - 1), st.integers(0, 255))
    for place, byte in data.draw(st.lists(places, min_size=1, max_size=4)):
        whole[place] = byte
    assert_read_or_refused(home, name, bytes(whole))


@pytest.mark.parametrize("name", READERS)
@given(content=st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
@FUZZED
def test_a_foreign_file(home: Home, name: str, content: bytes) -> None:
    assert_read_or_refused(home, name, content)


def test_nothing_that_a_jobs_configuration_names_is_called(home: Home) -> None:
    node = OmegaConf.load(home.files / CONFIG)
    OmegaConf.update(node, "value._target_", "pytest.fail", force_add=True)
    (home.damaged / CONFIG).write_text(OmegaConf.to_yaml(node))
    _, refused = read(home, CONFIG)
    assert "value._target_=pytest.fail: there is no value._target_" in (refused or "")
