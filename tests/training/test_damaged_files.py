"""Files from anywhere: each is read as it was written, or refused in one line that names it."""

import json
import os
import pickle
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

from fnnq_torchrl.files.plain import write_plain
from fnnq_torchrl.launch import command as cli  # noqa: F401  # with the resolvers that commands have
from fnnq_torchrl.studies.experiments import read_experiment
from fnnq_torchrl.training.checkpoint import load_checkpoint
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations, read_summary
from fnnq_torchrl.training.resume.saved import SavedTraining
from fnnq_torchrl.training.trainer import Trainer
from tests.programs import config

JOB = config("situations=5", "engine=eager", "num_seeds=2", "env.time_limit_steps=4")
TRAINING, CHECKPOINT = "training.pt", "checkpoint.pt"
CONFIG = ".hydra/config.yaml"


class Home(NamedTuple):
    """A finished job's directory, and one for damaged copies of its files."""

    files: Path
    damaged: Path


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Home:
    root = tmp_path_factory.mktemp("sweep")
    job = root / "0"
    (job / ".hydra").mkdir(parents=True)
    run_job(JOB, job)
    (job / CONFIG).write_text(OmegaConf.to_yaml(OmegaConf.create(asdict(JOB))))
    trainer = Trainer(JOB)
    trainer.learn()
    SavedTraining(job, JOB, "eager").save(trainer.ledger, [])
    damaged = tmp_path_factory.mktemp("damaged")
    shutil.copytree(job, damaged / "0")
    return Home(job, damaged / "0")


def load_training(path: Path) -> object:
    trainer = Trainer(JOB)
    SavedTraining(path.parent, JOB, "eager").load(trainer)
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
    """Binary files are read as they were written; of a text, another one may be a good one."""
    path = home.damaged / name
    path.write_bytes(data)
    found, refused = read(home, name)
    if refused is None and path.suffix == ".pt":
        assert same(found, READERS[name](home.files / name))


def read(home: Home, name: str) -> tuple[Any, str | None]:
    """What the damaged file holds or, if it is refused, the line; then it is whole again."""
    path = home.damaged / name
    try:
        return READERS[name](path), None
    except ValueError as error:  # ConfigError is one
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


STRANGE = {
    "deep": b"[" * 100_000,
    "null": b"null",
    "a list": b"[1, 2]",
    "a text": b'"text"',
    "keys that are no text": b"{1: 2, null: 3}",
    "a date there isn't": b"lam: 2001-99-99",
    "an open interpolation": b"lam: ${",
    "an interpolation of itself": b"lam: ${lam}",
    "a resolver there isn't": b"lam: ${nowhere:1}",
    "huge numbers": b"seed,lam,situations,steps,catches\n0,0.2,0,99999999999999999999,1e999\n",
    "no rows": b"seed,lam,situations,steps,catches\n\n",
    "NaN": b'{"runs": NaN}',
    "another job's pickle": pickle.dumps({"format": 1}),
}


@pytest.mark.parametrize("name", READERS)
@pytest.mark.parametrize("what", STRANGE)
def test_a_strange_file(home: Home, name: str, what: str) -> None:
    assert_read_or_refused(home, name, STRANGE[what])


class Code:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return (os.system, ("touch ran_code",))


@pytest.mark.parametrize("name", [TRAINING, CHECKPOINT])
@pytest.mark.parametrize("how", ["torch", "torch, entry", "pickle"])
def test_a_file_with_code_in_it_runs_none(
    home: Home, name: str, how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / name
    if how == "pickle":
        path.write_bytes(pickle.dumps(Code()))
    else:
        good = torch.load(home.files / name, weights_only=True)
        torch.save(Code() if how == "torch" else good | {"ledger": Code()}, path)
    with pytest.raises(ValueError, match=r"is not a (checkpoint|saved training)"):
        READERS[name](path)
    assert not (tmp_path / "ran_code").exists()


@pytest.mark.parametrize("key", ["_target_", "env._target_", "value._target_"])
def test_a_target_in_a_jobs_configuration_is_refused(
    home: Home, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    node = OmegaConf.load(home.files / CONFIG)
    OmegaConf.update(node, key, "os.system", force_add=True)
    OmegaConf.update(node, key.replace("_target_", "_args_"), ["touch ran_code"], force_add=True)
    (home.damaged / CONFIG).write_text(OmegaConf.to_yaml(node))
    _, refused = read(home, CONFIG)
    assert f"{key}=os.system: there is no {key}" in (refused or "")
    assert not (tmp_path / "ran_code").exists()


OTHERS: dict[str, Any] = {
    "a tensor": torch.zeros(3),
    "a list": [1, 2],
    "weights alone": {"weight": torch.zeros(2)},
    "an older format": {"format": 0},
    "a newer format": {"format": 99},
    "a format that is no number": {"format": "1"},
    "a format that is none": {"format": True},
    "nothing else": {"format": 1},
}


@pytest.mark.parametrize("name", [TRAINING, CHECKPOINT])
@pytest.mark.parametrize("what", OTHERS)
def test_another_programs_torch_file(home: Home, name: str, what: str, tmp_path: Path) -> None:
    torch.save(OTHERS[what], tmp_path / name)
    assert_read_or_refused(home, name, (tmp_path / name).read_bytes())


WRONG = [None, 1, "x", [], {}, [None], torch.zeros(0), torch.zeros(1), torch.zeros(2, 2, 2, 2)]


@given(data=st.data())
@settings(max_examples=40)
@pytest.mark.parametrize("name", [TRAINING, CHECKPOINT])
def test_a_file_with_a_wrong_entry(home: Home, name: str, data: st.DataObject) -> None:
    """Made by somebody who knows the format: whole, and not what it should be."""
    path, good = home.damaged / name, home.files / name
    content = torch.load(good, weights_only=True)
    entries = content["ledger"] if name == TRAINING else content
    entry = data.draw(st.sampled_from(sorted(entries.keys() - {"format"})))
    above, wrong = entry, data.draw(st.sampled_from(WRONG))
    if data.draw(st.booleans()) and isinstance(entries[entry], dict):
        entries, entry = entries[entry], next(iter(entries[entry]))
    entries[entry] = wrong
    write_plain(path, content.pop("format"), content)
    found, refused = read(home, name)
    if refused is None:
        expected = READERS[name](good)
        assert name == CHECKPOINT or above in ("hands", "seconds")  # which may be anything empty
        for key in expected.keys() - {above}:
            assert same(found[key], expected[key]), key


STATE = Trainer(JOB).begun.to_dict()
CRAFTED: dict[str, tuple[str, Any]] = {
    "more situations than there are": ("learned", torch.tensor([6, 0])),
    "a page that there isn't": ("collected", torch.tensor([0, 2])),
    "fewer catches than none": ("catches", torch.tensor([[-1, 0], [0, 0]])),
    "more catches than tests": ("catches", torch.tensor([[9, 0], [0, 0]])),
    "fewer steps than none": ("steps", torch.tensor([[0, 0], [-1, 0]])),
    "no time": ("seconds", {"train": float("nan")}),
    "the time of something else": ("seconds", {"dance": 1.0}),
    "the state of no run": ("hands", [(torch.tensor([7]), STATE)]),
    "a state without entries": ("hands", [(torch.tensor([0]), {})]),
    "a state of another precision": ("hands", [(torch.tensor([0]), STATE | {"alpha": 1})]),
    "a state before its beginning": (
        "hands",
        [(torch.tensor([0]), STATE | {"steps": torch.tensor([[-1]])})],
    ),
}


@pytest.mark.parametrize("what", CRAFTED)
def test_a_training_that_nothing_can_have_come_to(home: Home, what: str) -> None:
    """Made by somebody who knows the format and the configuration."""
    content = torch.load(home.files / TRAINING, weights_only=True)
    entry, crafted = CRAFTED[what]
    content["ledger"][entry] = crafted
    write_plain(home.damaged / TRAINING, content.pop("format"), content)
    _, refused = read(home, TRAINING)
    assert "is not a complete saved training" in (refused or "")


def test_a_state_in_hand_is_gone_on_from(home: Home) -> None:
    content = torch.load(home.files / TRAINING, weights_only=True)
    content["ledger"]["hands"] = [(torch.tensor([0]), STATE)]
    write_plain(home.damaged / TRAINING, content.pop("format"), content)
    _, refused = read(home, TRAINING)
    assert refused is None


def test_a_summary_of_other_types_is_refused(home: Home) -> None:
    good = json.loads((home.files / "summary.json").read_text())
    for key in good:
        for wrong in ("x", True, {}, ["x"], [[1]]):
            assert_refused(home, json.dumps(good | {key: wrong}))
    for key in ("runs", "learning_steps", "batch_runs", "mean_score", "denormal_runs", "lam"):
        assert_refused(home, json.dumps(good | {key: None}))


def assert_refused(home: Home, text: str) -> None:
    (home.damaged / "summary.json").write_text(text)
    _, refused = read(home, "summary.json")
    assert "summary.json is not a complete summary" in (refused or "")
