"""Batches as tasks of a cluster, run on this machine in processes of their own."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

import pytest

from fnnq_torchrl.launch.cluster import BatchTask
from fnnq_torchrl.training.jobs import Job, JobFailed
from fnnq_torchrl.training.resume.interruptions import Interruptions
from tests.commands import fnnq_train
from tests.programs import config

TINY = ("env.time_limit_steps=4", "situations=5", "engine=eager")


@pytest.mark.long
def test_a_sweep_on_this_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    submitit = pytest.importorskip("submitit")
    (tmp_path / "1" / "evaluations.csv").mkdir(
        parents=True
    )  # job 1 can't write it, so job 1 and the last job fail
    sweep = ("lam=0,0.4", "alpha=0.4,0.2", *TINY, f"hydra.sweep.dir={tmp_path}", "-m")
    assert fnnq_train("hydra.launcher.cluster=local", *sweep) == 1
    assert "job 1 (lam=0 alpha=0.2 " in capsys.readouterr().err
    (task,) = (tmp_path / ".submitit").glob("*_submitted.pkl")
    assert submitit.core.utils.DelayedSubmission.load(task)._timeout_countdown == 100
    finished = [number for number in range(4) if (tmp_path / f"{number}/summary.json").exists()]
    assert finished == [0, 2]
    for number in finished:
        assert json.loads((tmp_path / f"{number}/summary.json").read_text())["batch_runs"] == 4
    assert (tmp_path / "learning_curves.png").exists()
    assert len((tmp_path / "summary.csv").read_text().splitlines()) == 5


class Trainer:
    """A function in the trainer's place that only records the jobs."""

    def __init__(self) -> None:
        self.batches: list[list[str]] = []

    def __call__(
        self, batches: Sequence[Sequence[Job]], *, pictures: bool, interruptions: Interruptions
    ) -> Iterator[list[float | Exception]]:
        for batch in batches:
            self.batches.append([job.directory.name for job in batch])
            yield [JobFailed("as it happens") if job.config.seed == 9 else 2.5 for job in batch]


def test_a_requeued_task_trains_what_is_missing(tmp_path: Path, summary: dict[str, object]) -> None:
    jobs = [Job(replace(config(), seed=seed), tmp_path / str(seed)) for seed in (7, 8, 9)]
    for job in jobs:
        job.directory.mkdir()
    (tmp_path / "7" / "summary.json").write_text(json.dumps(summary | {"mean_score": 4.5}))

    submitit = pytest.importorskip("submitit")
    trainer = Trainer()
    task = BatchTask(trainer, pictures=False)
    again = task.checkpoint(jobs)
    assert isinstance(again, submitit.helpers.DelayedSubmission)
    objectives = again.function(*again.args)
    assert trainer.batches == [["8", "9"]]
    assert objectives[:2] == [4.5, 2.5]
    assert str(objectives[2]) == "as it happens"


def test_a_finished_batch_is_not_trained_again(tmp_path: Path, summary: dict[str, object]) -> None:
    pytest.importorskip("submitit")
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    trainer = Trainer()
    assert BatchTask(trainer, pictures=False)([Job(config(), tmp_path)]) == [summary["mean_score"]]
    assert trainer.batches == []


def test_a_task_that_timed_out_too_often_ends_badly(tmp_path: Path) -> None:
    gave_up = pytest.importorskip("submitit").core.utils.UncompletedJobError("timed out too often")

    def run_batches(
        batches: Sequence[Sequence[Job]], *, pictures: bool, interruptions: Interruptions
    ) -> Iterator[list[float | Exception]]:
        yield from ([gave_up] * len(batch) for batch in batches)

    with pytest.raises(type(gave_up), match="too often"):
        BatchTask(run_batches, pictures=False)([Job(config(), tmp_path)])


@pytest.fixture
def summary() -> dict[str, object]:
    from fnnq_torchrl.training.results import Summary

    numbers = {int: 1, list[float]: [1.0], list[float] | None: None, str: "successes"}
    return {key: numbers.get(of, 1.0) for key, of in get_type_hints(Summary).items()}
