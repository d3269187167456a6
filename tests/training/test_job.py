"""Whole jobs, from the configuration to the files."""

import errno
import json
import os
import signal
from dataclasses import fields, replace

import pytest
import torch

from envs.robot.schemas import FollowOneSideConfig
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.identity import ASIDE
from fnnq_torchrl.config.schema import (
    ActionConfig,
    Config,
    ConfigError,
    EvaluationConfig,
    MachineConfig,
)
from fnnq_torchrl.config.values import SCHEMAS as VALUES
from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.engine.choice import choose_engine
from fnnq_torchrl.training import job as job_module
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.job import run_batches, run_job
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.resume.interruptions import Interrupted, Lost
from fnnq_torchrl.training.resume.saved import SavedTraining
from fnnq_torchrl.training.trainer import Trainer
from fnnq_torchrl.training.weights import load_checkpoint, load_snapshots
from tests.programs import config as load_config  # a world of short situations

SCHEMAS = (Config, FollowOneSideConfig, LabelsConfig, ActionConfig, EvaluationConfig, MachineConfig)


def test_a_job_leaves_its_files_and_says_where(tmp_path, capsys):
    config = load_config("lam=0.2", "seed=3", "num_seeds=2", "situations=10")
    run_job(config, tmp_path)

    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"checkpoint.pt", "evaluations.csv", "learning_curve.png", "summary.json"}
    header, first, *rest = (tmp_path / "evaluations.csv").read_text().splitlines()
    assert header.startswith("seed,lam,situations,steps,catches")
    assert first.startswith("3,0.2,0,0,")
    assert len(rest) == 2 * 3 - 1
    evaluations = read_evaluations(tmp_path / "evaluations.csv")
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["runs"] == 2
    assert summary["learning_steps"] == evaluations.steps[:, -1].sum()
    assert summary["mean_score"] == evaluations.catches[:, 1:].mean()
    checkpoint = load_checkpoint(tmp_path / "checkpoint.pt")
    assert checkpoint.weights["weight"].shape == (2, 5, 4)
    assert checkpoint.weights["weight"].abs().sum() > 0
    assert checkpoint.config["situations"] == 10
    assert "learning_curve.png" in capsys.readouterr().out


def test_a_job_leaves_its_snapshots_if_it_is_to(tmp_path):
    config = load_config("seed=3", "num_seeds=2", "situations=10", "checkpoint.snapshots=true")
    run_job(config, tmp_path)
    snapshots = load_snapshots(tmp_path / "snapshots.pt")
    assert snapshots.situations.tolist() == [0, 5, 10]
    assert snapshots.seed.tolist() == [3, 4]
    assert snapshots.weights["weight"].shape == (3, 2, 5, 4)
    assert snapshots.weights["weight"][0].eq(0).all()
    last = load_checkpoint(tmp_path / "checkpoint.pt").weights["weight"]
    assert snapshots.weights["weight"][-1].equal(last)
    assert snapshots.config["checkpoint"]["snapshots"]

    run_job(replace(config, checkpoint=replace(config.checkpoint, snapshots=False)), tmp_path)
    assert not (tmp_path / "snapshots.pt").exists()  # an earlier job's doesn't belong here


def test_a_job_is_the_same_every_time(tmp_path):
    config = load_config("seed=5", "situations=5")
    for name in ("once", "again"):
        (tmp_path / name).mkdir()
        run_job(config, tmp_path / name)
    once, again = ((tmp_path / name / "evaluations.csv").read_bytes() for name in ("once", "again"))
    assert once == again


@pytest.mark.skipif(torch.cuda.is_available(), reason="needs a machine without CUDA")
def test_a_missing_device_is_told(tmp_path):
    with pytest.raises(ConfigError, match=r"^machine.device=cuda: .* 0 CUDA"):
        run_job(load_config("machine=cuda"), tmp_path)
    assert not list(tmp_path.iterdir())


# Keys that are read only where labels have words or are found (test_memberships.py).
OF_LABELS = {
    *("names", "labels_of_input", "labels_of_action", "clustering", "visited", "warm_up"),
    "least_width",
}


def names_of(schema):
    names = {field.name for field in fields(schema)}
    return names - OF_LABELS if issubclass(schema, LabelsConfig) else names


def record_keys_read(schemas, monkeypatch):
    """Return a set that collects the configuration keys read from now on, as (schema, name)."""
    read = set()
    for schema in schemas:

        def recording(self, name, schema=schema):
            if name in names_of(schema):
                read.add((schema, name))
            return object.__getattribute__(self, name)

        monkeypatch.setattr(schema, "__getattribute__", recording)
    return read


@pytest.mark.parametrize("kind", VALUES)
def test_every_key_of_a_value_function_is_read(monkeypatch, kind):
    config, schema = load_config(f"value={kind}").value, VALUES[kind]
    read = record_keys_read([schema], monkeypatch)
    make_value_network(config, torch.linspace(-1, 1, 3), runs=1)
    assert read == {(schema, name) for name in names_of(schema)}


def test_every_key_is_read_by_something(monkeypatch):
    config = load_config("situations=5", "env=follow_one_side")
    read = record_keys_read(SCHEMAS, monkeypatch)
    trainer = Trainer.of(config)
    trainer.learn()
    trainer.evaluate()

    scheme = ("adaptive=doya", "exploration=boltzmann", "step_size=constant")
    Trainer.of(load_config("situations=5", "env=follow_one_side", *scheme)).make_learner(lanes=1)
    read |= {(Config, key) for key in ASIDE}  # read by the job (tested below) and by the loggers
    assert read == {(schema, name) for schema in SCHEMAS for name in names_of(schema)}


def save_half_done(config, directory, jobs=()):
    """Save a training that has only begun, of one job or of all given jobs."""
    batch = Batch([*jobs] or [Job(config, directory)])
    trainer = Trainer(batch.config, batch.runs, batch.engine)
    # All tests count as catches though nothing was learned, which shows that a job has resumed.
    trainer.ledger.results["success"].fill_(True)
    trainer.ledger.results["played"].fill_(True)
    SavedTraining(batch).save(trainer.ledger, [])


def test_a_job_goes_on_unless_it_is_to_begin_anew(tmp_path, capsys):
    config = load_config("situations=5")
    save_half_done(config, tmp_path)
    run_job(replace(config, resume="never"), tmp_path)
    assert read_evaluations(tmp_path / "evaluations.csv").catches.min() < 5
    assert not (tmp_path / "training.pt").exists()
    save_half_done(config, tmp_path)
    run_job(config, tmp_path)
    assert read_evaluations(tmp_path / "evaluations.csv").catches.min() == 5
    assert not (tmp_path / "training.pt").exists()
    assert "going on from" in capsys.readouterr().err


@pytest.mark.parametrize(("every_s", "saves"), [(1e-9, True), (1e9, False)])
def test_a_job_is_saved_at_intervals(tmp_path, monkeypatch, every_s, saves):
    seen = []
    save = SavedTraining.save

    def saving(self, ledger, hands):
        save(self, ledger, hands)
        seen.append(self.path.stat().st_size)

    monkeypatch.setattr(SavedTraining, "save", saving)
    run_job(load_config("situations=5", f"checkpoint.every_s={every_s}"), tmp_path)
    assert bool(seen) == saves
    assert all(seen)


@pytest.mark.parametrize("situations", [5, 200, 10_000])
def test_the_engine_doesnt_depend_on_the_batch_that_a_job_is_in(situations):
    """Engines agree only to rounding, and a job must be the same alone and in a batch."""
    config = load_config(f"situations={situations}")
    alone = choose_engine(config, 1).name
    among_many = choose_engine(config, 100_000).name
    assert alone == among_many


def test_a_signal_ends_all_batches(tmp_path, monkeypatch):
    begun = []

    def interrupted(batch, saved, pictures, interruptions):
        begun.append(batch)
        raise Interrupted(15)

    monkeypatch.setattr(job_module, "_run_batch", interrupted)
    batch = [Job(load_config("situations=5"), tmp_path)]
    with pytest.raises(Interrupted):
        list(run_batches([batch, batch], pictures=False))
    assert len(begun) == 1


@pytest.mark.usefixtures("usual_signals")
def test_a_signal_while_files_are_written_ends_what_comes_after(tmp_path, monkeypatch):
    """The files of this batch are completed, and the next batch doesn't begin."""
    write = job_module._write

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGTERM)
        return write(*arguments)

    monkeypatch.setattr(job_module, "_write", interrupted)
    jobs = [Job(load_config("situations=5"), tmp_path / name) for name in ("first", "second")]
    for job in jobs:
        job.directory.mkdir()
    results = run_batches([[job] for job in jobs], pictures=False)
    [score] = next(results)
    assert isinstance(score, float)
    assert (jobs[0].directory / "summary.json").exists()
    with pytest.raises(Interrupted):
        next(results)
    assert not (jobs[1].directory / "summary.json").exists()


@pytest.mark.usefixtures("usual_signals")
def test_a_job_whose_files_are_being_written_ends_as_any_other(tmp_path, monkeypatch):
    write = job_module.write_summary

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGTERM)
        write(*arguments)

    monkeypatch.setattr(job_module, "write_summary", interrupted)
    assert run_job(load_config("situations=5"), tmp_path) >= 0


def test_each_line_of_several_batches_says_whose_it_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    small = ("situations=5", "engine=eager")
    batches = [
        [Job(load_config(f"trace={trace}", *small), tmp_path / "sweep" / trace, tmp_path / "sweep")]
        for trace in ("output", "gradient")
    ]
    for [job] in batches:
        job.directory.mkdir(parents=True)
    list(run_batches(batches, pictures=False))
    lines = capsys.readouterr().err.splitlines()
    assert {line.partition(": ")[0] for line in lines} == {
        "sweep, batch 1 of 2",
        "sweep, batch 2 of 2",
    }


def test_an_earlier_picture_does_not_stay_beside_new_files(tmp_path):
    (tmp_path / "learning_curve.png").write_text("another job's")
    list(run_batches([[Job(load_config("situations=5"), tmp_path)]], pictures=False))
    assert not (tmp_path / "learning_curve.png").exists()


def test_a_full_disk_leaves_the_training_to_go_on_from(tmp_path, capsys):
    config = load_config("situations=5")
    jobs = [Job(replace(config, seed=seed), tmp_path / str(seed), tmp_path) for seed in range(3)]
    for job in jobs:
        job.directory.mkdir()
    save_half_done(config, jobs[-1].directory, jobs)
    (jobs[0].directory / "evaluations.csv").mkdir()
    [[first, second, last]] = run_batches([jobs], pictures=False)
    assert isinstance(first, OSError)
    assert isinstance(second, float)
    assert last is first
    assert [path.name for path in jobs[-1].directory.iterdir()] == ["training.pt"]

    (jobs[0].directory / "evaluations.csv").rmdir()
    capsys.readouterr()
    [results] = run_batches([[jobs[0], jobs[2]]], pictures=False)
    assert "going on from" in capsys.readouterr().err
    assert all(isinstance(result, float) for result in results)
    assert not (jobs[-1].directory / "training.pt").exists()


@pytest.mark.parametrize("ordered", [False, True], ids=["", "SIGTERM"])
@pytest.mark.usefixtures("usual_signals")
def test_a_save_that_fails_ends_only_what_ends_anyway(tmp_path, monkeypatch, capsys, ordered):
    attempts = []

    def full(self, ledger, hands):
        attempts.append(hands)
        if ordered and len(attempts) == 1:  # a second signal would end it at once
            os.kill(os.getpid(), signal.SIGTERM)
        raise OSError(errno.ENOSPC, "No space left on device", str(self.path))

    monkeypatch.setattr(SavedTraining, "save", full)
    config = load_config("situations=5", "env.time_limit_steps=4", "checkpoint.every_s=1e-9")
    if ordered:
        with pytest.raises(Lost, match=r"^SIGTERM: .* lost: .*No space .*training\.pt") as ended:
            run_job(config, tmp_path)
        assert ended.value.status == 1
    else:
        run_job(config, tmp_path)
        assert len(attempts) > 1
        assert capsys.readouterr().err.count("can't be saved, for now: ") == 1
    assert (tmp_path / "summary.json").exists() != ordered


def test_a_damaged_training_is_told_before_any_batch_begins(tmp_path, monkeypatch):
    begun = []
    monkeypatch.setattr(job_module, "_run_batch", lambda batch, *_: begun.append(batch))
    (tmp_path / "second").mkdir()
    (tmp_path / "second" / "training.pt").write_bytes(b"damage")
    config = load_config("situations=5")
    batches = [[Job(config, tmp_path / name)] for name in ("first", "second")]
    with pytest.raises(ConfigError, match=r"second/training\.pt is damaged, or not"):
        list(run_batches(batches, pictures=False))
    assert begun == []


def test_an_earlier_summary_does_not_stay_beside_new_files(tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    (tmp_path / "evaluations.csv").mkdir()
    with pytest.raises(IsADirectoryError):
        run_job(load_config("situations=5"), tmp_path)
    assert not (tmp_path / "summary.json").exists()


def test_diverged_runs_are_told_and_counted(tmp_path, capsys):
    """Some runs of the batch diverge at once; the others aren't affected."""
    jobs = [
        Job(load_config("situations=10", "num_seeds=2", f"alpha={alpha}"), tmp_path / f"{alpha}")
        for alpha in (0.4, 1e30)
    ]
    for job in jobs:
        job.directory.mkdir()
    (tmp_path / "alone").mkdir()
    ((well, ill),) = run_batches([jobs], pictures=True)
    told = capsys.readouterr().err
    assert "diverged: 2 of 4 runs (seed 0 of job 1e+30, 1 of job 1e+30); they stopped" in told
    assert run_job(jobs[0].config, tmp_path / "alone") == well
    assert "diverged: " not in capsys.readouterr().err

    diverged = read_evaluations(jobs[1].directory / "evaluations.csv")
    assert diverged.diverged.tolist() == [[False, True, True]] * 2
    assert (diverged.catches[:, 1:] == 0).all()
    assert ill == 0
    steps = diverged.steps[:, 1:]
    assert (steps == steps[:, :1]).all()  # a diverged run has stopped
    assert (steps > 0).all()
    summary = json.loads((jobs[1].directory / "summary.json").read_text())
    assert (summary["runs"], summary["diverged_runs"]) == (2, 2)
    assert load_checkpoint(jobs[1].directory / "checkpoint.pt").weights["weight"].isfinite().all()
