"""Jobs, from their configurations to the files of their output directories."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import asdict
from itertools import accumulate, chain, pairwise
from pathlib import Path

import torch
from tensordict import TensorDictBase
from torch import Tensor

from envs.core.contract import check_world
from envs.core.registry import is_own
from envs.worlds import make_world
from fnnq_torchrl.agent.rules import partition
from fnnq_torchrl.config.schema import Config, ConfigError, OutOfRange
from fnnq_torchrl.files.atomic import clear_leftovers
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.firing import FIRING, write_firing
from fnnq_torchrl.training.jobs import SNAPSHOTS, Job, JobFailed
from fnnq_torchrl.training.loggers import Loggers
from fnnq_torchrl.training.memberships import gaps_in_words, with_found_labels
from fnnq_torchrl.training.memory import check_memory
from fnnq_torchrl.training.pictures import learning_curve
from fnnq_torchrl.training.results import (
    Outcome,
    read_summary,
    summarise,
    write_evaluations,
    write_summary,
)
from fnnq_torchrl.training.resume.interruptions import Interrupted, Interruptions
from fnnq_torchrl.training.resume.keeper import Hand, HandsKeeper
from fnnq_torchrl.training.resume.saved import SavedTraining
from fnnq_torchrl.training.terminal import Progress, announce, print_summary
from fnnq_torchrl.training.trainer import Trainer
from fnnq_torchrl.training.weights import save_checkpoint, save_snapshots

PICTURE = "learning_curve.png"
"""The file with the learning curve."""

_WRITERS = 8
"""Threads that write files of different jobs."""

_NAMED = 5
"""Diverged runs that are named; the others are counted."""


def run_job(config: Config, directory: Path) -> float:
    """Train all runs of a job and say what came of it.

    Leaves ``checkpoint.pt``, ``snapshots.pt`` and ``firing.csv`` if it is to, ``evaluations.csv``,
    ``learning_curve.png`` and, last of all, ``summary.json`` in the directory, and a table on the
    screen.

    Returns:
        The objective, the mean score over the runs.

    Raises:
        OutOfRange: the device isn't there.
        Interrupted: a signal has ended the work, which is saved.
        Lost: a signal has ended the work, which couldn't be saved.
        ConfigError: the job needs more memory than there is; a saved training isn't this one's, or
            is damaged; or the engine is to compile, and the compiler isn't there or fails.
        OSError: a file can't be written.
    """
    with closing(Loggers()) as loggers:
        # Whatever signal came while the files were written: there is nothing left to be interrupted
        [result] = next(run_batches([[Job(config, directory)]], pictures=True, loggers=loggers))
        if isinstance(result, Exception):
            raise result
        print_summary(read_summary(directory / "summary.json"), directory / PICTURE)
    return result


def run_batches(
    batches: Sequence[Sequence[Job]],
    *,
    pictures: bool,
    loggers: Loggers | None = None,
    interruptions: Interruptions | None = None,
) -> Iterator[list[float | Exception]]:
    """Train the jobs of each batch side by side.

    A job leaves the files that it would leave alone, the same bit for bit but for the wall times
    in ``summary.json``, which are its batch's.

    Args:
        batches: of jobs that are equal but for `fnnq_torchrl.training.jobs.BATCHABLE`.
        pictures: whether each job gets its ``learning_curve.png``; they take longer to draw than
            many a run takes to learn.
        loggers: the command's, who closes them; if not given, there are some for these jobs alone.
        interruptions: say when to save and when to end. By default each batch has its own, which
            save every ``checkpoint.every_s``.

    Yields:
        The results of a batch's jobs. One that failed leaves the others as they are.

    Raises:
        OutOfRange: a device isn't there; before any batch begins.
        ConfigError: a batch needs more memory than there is, or a saved training isn't this one's,
            or is damaged; before any batch begins. Or an engine is to compile, and the compiler
            isn't there, or fails; or a logger's library isn't there, or a login that it's to use.
        Interrupted: a signal has ended the work, which is saved. One that comes while files are
            written or logged does so when its batch is done, and its results are yielded.
        Lost: a signal has ended the work, which couldn't be saved.
    """
    if loggers is None:
        with closing(Loggers()) as loggers:
            yield from run_batches(
                batches, pictures=pictures, loggers=loggers, interruptions=interruptions
            )
        return
    prepared = [Batch(with_found_labels(jobs)) for jobs in batches]
    for batch in prepared:
        _check(batch)
    saved = [SavedTraining(batch) for batch in prepared]
    for each in saved:
        each.read()
    loggers.prepare(chain.from_iterable(batches))
    for batch, training in zip(prepared, saved, strict=True):
        results: list[float | Exception]
        with interruptions or Interruptions(batch.config.checkpoint.every_s) as work:
            try:
                results = _run_batch(batch, training, pictures, work)
            except (ConfigError, Interrupted):
                raise
            except Exception as error:  # a bug, or too little memory: the other batches may do
                results = [error] * len(batch.jobs)
            # Of jobs whose files are there, and in this thread: not all loggers know of others.
            for job, result in zip(batch.jobs, results, strict=True):
                if isinstance(result, float):
                    loggers.log_job(job)
        yield results
        work.obey()


def _check(batch: Batch) -> None:
    """Refuse what can't be computed, and remove what killed processes have left."""
    config = batch.config
    device = torch.device(config.machine.device)
    found = torch.cuda.device_count()
    if device.type == "cuda" and found <= (device.index or 0):
        allowed = f"there: this machine has {found} CUDA devices"
        raise OutOfRange("machine.device", config.machine.device, allowed)
    if is_own(config.env.kind):
        dtype = getattr(torch, config.machine.dtype)
        check_world(make_world(config.env, [2], dtype=dtype, device=device))
    if large := check_memory(batch):
        announce(large)
    for job in batch.jobs:
        clear_leftovers(job.directory)


def _run_batch(
    batch: Batch, saved: SavedTraining, pictures: bool, interruptions: Interruptions
) -> list[float | Exception]:
    trainer = Trainer(batch.config, batch.runs, batch.engine, batch.start)
    announce(batch.engine.why)
    if gaps := gaps_in_words(batch.config):
        announce(gaps)
    if batch.start is not None and batch.start.told:
        announce(batch.start.told)
    outcome = _train(trainer, saved, interruptions)
    _announce_diverged(outcome)
    bounds = accumulate((job.config.num_seeds for job in batch.jobs), initial=0)
    *others, last = zip(batch.jobs, pairwise(bounds), strict=True)

    def write(job_and_bounds: tuple[Job, tuple[int, int]]) -> float | Exception:
        job, (begin, end) = job_and_bounds
        runs = slice(begin, end)
        try:
            ledger = trainer.ledger
            fired = None if ledger.fired is None else ledger.fired[runs]
            return _write(job, outcome.of(runs), ledger.book.pages[:, runs], fired, pictures)
        except OSError as error:
            return error
        except ValueError as error:  # a score that is no number
            return JobFailed(f"{job.directory}: {error}")

    # Mostly the disk is waited for; but Matplotlib knows one thread only.
    with ThreadPoolExecutor(1 if pictures else _WRITERS) as pool:
        results = [*pool.map(write, others)]
    # The last job's directory holds training.pt, so its files are written last: a restart resumes.
    unwritten = next((result for result in results if isinstance(result, OSError)), None)
    results.append(unwritten or write(last))
    if isinstance(results[-1], OSError):
        with suppress(OSError):  # mostly for the same reason; an earlier one stays
            saved.save(trainer.ledger, [])
    else:
        saved.discard()
    return results


def _train(trainer: Trainer, saved: SavedTraining, interruptions: Interruptions) -> Outcome:
    """All of it, or what was left of it; saved from time to time, and when a signal ends it."""
    if saved.restore(trainer.ledger):
        announce(f"going on from {saved.path}")
    told = set()

    def save(hands: Sequence[Hand]) -> None:
        try:
            saved.save(trainer.ledger, hands)
        except OSError as error:
            if not (interruptions.ending or str(error) in told):
                told.add(str(error))
                announce(f"going on, but this training can't be saved, for now: {error}")
            raise

    keeper = HandsKeeper(interruptions, save)
    with interruptions.watched():
        with Progress(trainer.situations_to_learn, "learning") as progress:
            trainer.learn(progress.update, keeper)
        with Progress(trainer.situations_to_play, "evaluating") as progress:
            outcome = trainer.evaluate(progress.update, keeper)
        keeper.finish()
    return outcome


def _write(
    job: Job, outcome: Outcome, pages: TensorDictBase, fired: Tensor | None, pictures: bool
) -> float:
    directory, config = job.directory, job.config
    evaluations = directory / "evaluations.csv"
    for name in ("summary.json", SNAPSHOTS, FIRING, PICTURE):  # an earlier one isn't of these files
        (directory / name).unlink(missing_ok=True)
    settings = asdict(config)
    del settings["logger"]  # which has no say in the weights, and may not be there where they go
    weights, runs = pages["weights"], (outcome.seed, outcome.lam, settings)
    save_checkpoint(directory / "checkpoint.pt", weights[-1], *runs)
    if config.checkpoint.snapshots:
        save_snapshots(directory / SNAPSHOTS, weights, outcome.situations, *runs)
    if fired is not None:
        variables = partition(config.value, config.env)
        write_firing(directory / FIRING, outcome.seed.tolist(), fired, variables)
    write_evaluations(evaluations, outcome)
    if pictures:
        learning_curve(evaluations, directory / PICTURE, config.best_score, outcome.measure)
    summary = summarise(outcome)
    write_summary(directory / "summary.json", summary)
    return summary["mean_score"]


def _announce_diverged(outcome: Outcome) -> None:
    """One line, if runs have diverged."""
    if not outcome.diverged_runs:
        return
    seeds = outcome.seed[outcome.diverged[:, -1]].tolist()
    announce(
        f"diverged: {len(seeds):,} of {outcome.runs:,} runs (seed {_some(seeds)}); they stopped, "
        "and count as catching nothing from then on. A smaller alpha may help"
    )


def _some(seeds: list[int]) -> str:
    return ", ".join(map(str, seeds[:_NAMED])) + ", …" * (len(seeds) > _NAMED)
