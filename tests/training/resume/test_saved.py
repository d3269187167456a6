"""An interrupted training resumes and has the same results, bit for bit."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tensordict import TensorDictBase

from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.engine.choice import make_engine
from fnnq_torchrl.engine.loops import Loop, MakeLoop, MakeStep
from fnnq_torchrl.files import plain
from fnnq_torchrl.files.plain import read_plain
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.results import Outcome
from fnnq_torchrl.training.resume.interruptions import Interrupted, Interruptions
from fnnq_torchrl.training.resume.keeper import HandsKeeper
from fnnq_torchrl.training.resume.saved import FORMAT, SavedTraining
from fnnq_torchrl.training.trainer import Trainer
from tests.programs import config

CPU = torch.device("cpu")
RUNS = 70
JOB = config(f"num_seeds={RUNS}", "situations=20", "engine=compiled")


class Stop(Interruptions):
    """Interruptions that ask for a save at a given visit of the keeper, and end the training."""

    def __init__(self, at: int) -> None:
        super().__init__(1e9)
        self.visits_left = at

    def due(self) -> bool:
        self.visits_left -= 1
        return self.visits_left <= 0

    @property
    def ending(self) -> bool:
        return self.visits_left <= 0

    def saved(self) -> None:
        raise Interrupted(15)


@cache
def loop_of(engine: MakeLoop, *keys: str) -> list[Loop]:
    """Return a list, at first empty, in which all trainers share a compiled loop.

    Args:
        engine: the function that makes the loop.
        keys: the keys of the loop's state, which distinguish the learner's loop from the test's.
    """
    return []


def batch_of(job: Config, directory: Path, engine: str = "compiled") -> Batch:
    batch = Batch([Job(job, directory)])
    batch.engine = make_engine(engine, CPU)
    return batch


def make_trainer(job: Config) -> Trainer:
    """Return a trainer with few lanes, so that runs take turns; compiled loops are shared."""
    trainer = Trainer(job, Runs.of([job]), make_engine("compiled", CPU))
    make_loop = trainer.engine.make_loop

    def make_once(
        make_step: MakeStep,
        stays: TensorDictBase,
        state: TensorDictBase,
        recipe: str | None = None,
    ) -> Loop:
        made = loop_of(make_loop, *state.keys())
        if not made:
            made.append(make_loop(make_step, stays, state, recipe))
        return made[0]

    trainer.engine = replace(trainer.engine, make_loop=make_once, most_lanes=32, workers=2)
    return trainer


def go_on(trainer: Trainer, directory: Path, stop_at: int) -> Outcome | None:
    """Resume the training; return its outcome, or None if visit ``stop_at`` interrupts it."""
    saved = SavedTraining(batch_of(trainer.config, directory))
    saved.read()
    saved.restore(trainer.ledger)
    keeper = HandsKeeper(Stop(stop_at), partial(saved.save, trainer.ledger))
    try:
        trainer.learn(keeper=keeper)
        outcome = trainer.evaluate(keeper=keeper)
        keeper.finish()
    except Interrupted:
        return None
    return outcome


def restored(batch: Batch, trainer: Trainer) -> bool:
    saved = SavedTraining(batch)
    saved.read()
    return saved.restore(trainer.ledger)


NEVER = 10**9


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory, compiler: None):
    trainer = make_trainer(JOB)
    return go_on(trainer, tmp_path_factory.mktemp("whole"), NEVER), trainer.weights


def assert_same(outcome: Outcome, trainer: Trainer, expected, runs: slice = slice(None)) -> None:
    whole, weights = expected
    for name in ("seed", "lam", "steps", "catches"):
        assert np.array_equal(getattr(outcome, name), getattr(whole, name)[runs]), name
    assert torch.equal(trainer.weights["weight"], weights["weight"][runs])


@given(st.lists(st.integers(1, 30), min_size=1, max_size=3))
@settings(max_examples=8)
def test_an_interrupted_training_comes_to_the_same_end(
    tmp_path_factory: pytest.TempPathFactory, uninterrupted, stops: list[int]
) -> None:
    directory = tmp_path_factory.mktemp("job")
    for stop in (*stops, NEVER):
        trainer = make_trainer(JOB)
        outcome = go_on(trainer, directory, stop)
    assert_same(outcome, trainer, uninterrupted)


@pytest.mark.long
def test_what_a_step_size_remembers_is_saved(tmp_path: Path, compiler: None) -> None:
    job = config(f"num_seeds={RUNS}", "situations=20", "engine=compiled", "step_size=autostep")
    whole = make_trainer(job)
    expected = go_on(whole, tmp_path / "whole", NEVER), whole.weights
    for stop in (2, 5, NEVER):
        trainer = make_trainer(job)
        outcome = go_on(trainer, tmp_path, stop)
    assert_same(outcome, trainer, expected)


def test_nothing_that_is_done_is_done_again(tmp_path: Path, uninterrupted) -> None:
    first = make_trainer(JOB)
    assert go_on(first, tmp_path, stop_at=6) is None
    again = make_trainer(JOB)
    assert restored(batch_of(JOB, tmp_path), again)
    learned = again.ledger.learned
    assert 0 < int(learned.sum()) < RUNS * JOB.situations
    assert (learned <= first.ledger.learned).all()  # the other worker was between two visits
    assert again.ledger.seconds["train"] > 0
    begun = torch.cat([jobs for jobs, _ in again.ledger.hands])
    assert (learned[begun] < JOB.situations).any()


def in_hand(directory: Path) -> dict[int, int]:
    """Return by run the situations that each begun, unfinished run of a saved training learned."""
    ledger = read_plain(directory / "training.pt", FORMAT, "a saved training")["ledger"]
    found = {}
    for jobs, state in ledger["hands"]:
        learned = ledger["learned"][jobs] < JOB.situations
        pairs = zip(jobs[learned].tolist(), state["situations"][learned].tolist(), strict=True)
        for run, [situations] in pairs:
            assert run not in found
            found[run] = situations
    return found


@pytest.mark.parametrize("workers", [2, 1])
def test_what_nobody_has_gone_on_with_yet_stays_saved(
    tmp_path: Path, compiler: None, workers: int
) -> None:
    first, again = make_trainer(JOB), make_trainer(JOB)
    first.engine = replace(first.engine, most_lanes=64, workers=1)
    assert go_on(first, tmp_path, stop_at=3) is None
    before = in_hand(tmp_path)
    assert len(before) == 64
    again.engine = replace(again.engine, most_lanes=32, workers=workers)
    assert go_on(again, tmp_path, stop_at=1) is None
    after = in_hand(tmp_path)
    done = {run for run in before if again.ledger.learned[run] == JOB.situations}
    assert before.keys() <= after.keys() | done
    assert all(after[run] >= before[run] for run in before.keys() & after.keys())
    assert sum(after.values()) > sum(before.values())


def test_a_part_of_the_runs_can_go_on_alone(tmp_path: Path, uninterrupted) -> None:
    assert go_on(make_trainer(JOB), tmp_path, stop_at=9) is None
    runs = slice(30, 60)
    part = replace(JOB, seed=30, num_seeds=30)
    trainer = make_trainer(part)
    # The job is the last of a sweep, whose other jobs are finished.
    batch = batch_of(part, tmp_path)
    batch.jobs = [replace(batch.jobs[0], sweep=tmp_path.parent)]
    assert restored(batch, trainer)
    assert trainer.ledger.learned.any()
    trainer.learn()
    assert_same(trainer.evaluate(), trainer, uninterrupted, runs)


@pytest.fixture
def saved(tmp_path: Path, compiler: None) -> Path:
    trainer = make_trainer(JOB)
    training = SavedTraining(batch_of(JOB, tmp_path))
    training.save(trainer.ledger, [])
    return training.path


@pytest.mark.parametrize(
    ("job", "engine"),
    [
        (replace(JOB, trace="gradient"), "compiled"),
        (replace(JOB, situations=25), "compiled"),
        (JOB, "eager"),
        (replace(JOB, num_seeds=RUNS + 1), "compiled"),
        (replace(JOB, seed=1), "compiled"),
        (replace(JOB, lam=0.5), "compiled"),
    ],
    ids=["trace", "situations", "engine", "more runs", "seeds", "lam"],
)
def test_another_trainings_file_is_refused(saved: Path, job: Config, engine: str) -> None:
    with pytest.raises(ConfigError, match=r"another configuration.*; .*resume=never") as refused:
        SavedTraining(batch_of(job, saved.parent, engine)).read()
    assert len(str(refused.value).splitlines()) == 1
    assert str(refused.value).count("resume=never") == 1


def test_more_runs_than_are_asked_for_are_not_thrown_away(saved: Path) -> None:
    fewer = batch_of(replace(JOB, num_seeds=RUNS - 1), saved.parent)
    line = rf"was saved with {RUNS} runs, not num_seeds={RUNS - 1}; .*resume=never"
    with pytest.raises(ConfigError, match=line):
        SavedTraining(fewer).read()


@pytest.mark.parametrize(
    "job",
    [replace(JOB, resume="never"), replace(JOB, checkpoint=replace(JOB.checkpoint, every_s=1.0))],
    ids=["resume", "checkpoint"],
)
def test_what_learning_does_not_depend_on_does_not_matter(saved: Path, job: Config) -> None:
    assert restored(batch_of(job, saved.parent), make_trainer(job)) == (job.resume == "auto")


def test_another_pytorchs_file_is_refused(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "__version__", "0.4")
    with pytest.raises(ConfigError, match=r"version of PyTorch; .*resume=never"):
        SavedTraining(batch_of(JOB, saved.parent)).read()


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "cut short": lambda data: data[: len(data) // 2],
    "foreign": lambda data: b"seed,lam\n1,2\n",
    "bits flipped": lambda data: (
        data[:200] + bytes(byte ^ 0xFF for byte in data[200:260]) + data[260:]
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_file_is_told_in_one_line(saved: Path, damage: str) -> None:
    saved.write_bytes(DAMAGE[damage](saved.read_bytes()))
    with pytest.raises(ConfigError, match=r"training\.pt is .*not .*resume=never") as refused:
        SavedTraining(batch_of(JOB, saved.parent)).read()
    assert len(str(refused.value).splitlines()) == 1


def test_a_file_that_would_run_code_is_refused(saved: Path) -> None:
    class Code:
        def __reduce__(self):
            return (pytest.fail, ("ran code",))

    torch.save({"format": FORMAT, "identity": "", "ledger": Code()}, saved)
    with pytest.raises(ConfigError, match="is damaged, or not a saved training"):
        SavedTraining(batch_of(JOB, saved.parent)).read()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full disk")
def test_a_full_disk_is_told_as_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    @contextmanager
    def full(path: Path) -> Iterator[BinaryIO]:
        with open("/dev/full", "wb", buffering=0) as file:
            yield file

    monkeypatch.setattr(plain, "atomic_write", full)
    with pytest.raises(OSError, match="No space"):
        plain.write_plain(tmp_path / "training.pt", 1, {"weight": torch.zeros(100_000)})
