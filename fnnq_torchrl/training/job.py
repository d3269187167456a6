"""Trains jobs and writes the files of their output directories."""

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
from fnnq_torchrl.agent.parts import check_own
from fnnq_torchrl.agent.rules import partition
from fnnq_torchrl.config.schema import Config, ConfigError, OutOfRange
from fnnq_torchrl.files.atomic import clear_leftovers
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.drawing import draw_job, draw_video
from fnnq_torchrl.training.firing import FIRING, write_firing
from fnnq_torchrl.training.jobs import (
    PICTURE,
    SNAPSHOTS,
    VIDEO,
    Job,
    JobFailed,
)
from fnnq_torchrl.training.loggers import Loggers
from fnnq_torchrl.training.memberships import gaps_in_words, with_found_labels
from fnnq_torchrl.training.memory import check_memory
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
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.sharing import sharing_in_words
from fnnq_torchrl.training.solved import SOLVED, is_watched, write_solved
from fnnq_torchrl.training.start import with_imported_labels
from fnnq_torchrl.training.terminal import Progress, announce, print_summary
from fnnq_torchrl.training.trainer import Trainer
from fnnq_torchrl.training.weights import save_checkpoint, save_snapshots

_WRITERS = 8
"""The number of threads that write files; each writes those of one job at a time."""

_NAMED = 5
"""The most seeds of diverged runs that a line names."""


def run_job(config: Config, directory: Path) -> float:
    """Train all runs of a job, write its files and print its table.

    The files are written in this order: ``checkpoint.pt``, ``snapshots.pt`` (only with
    ``checkpoint.snapshots=true``), ``firing.csv`` (only with ``rules.count_firing=true``),
    ``solved.csv`` (only in a world that states its best mean reward), ``evaluations.csv``,
    ``summary.json``, ``learning_curve.png``, ``parameters.png`` (only with adaptive parameters) and
    ``robot.gif`` (only with ``logger.video=true``); the last three unless drawing fails.

    Returns:
        The mean score over the runs, which is the job's objective.

    Raises:
        OutOfRange: if the machine lacks the device.
        Interrupted: if a signal has ended the work, and the work is saved.
        Lost: if a signal has ended the work, and the work couldn't be saved.
        ConfigError: if the job needs more memory than is free; a saved training is damaged or
            belongs to another job; or the engine must compile, and the compiler is missing or
            fails.
        OSError: if a file can't be read or written.
        JobFailed: if a score is NaN or infinite.
    """
    with closing(Loggers()) as loggers:
        # The generator isn't run to its end, where it would obey a signal: the job is finished.
        [result] = next(run_batches([[Job(config, directory)]], pictures=True, loggers=loggers))
        if isinstance(result, Exception):
            raise result
        picture = directory / PICTURE
        summary = read_summary(directory / "summary.json")
        print_summary(summary, picture if picture.exists() else None)
    return result


def run_batches(
    batches: Sequence[Sequence[Job]],
    *,
    pictures: bool,
    loggers: Loggers | None = None,
    interruptions: Interruptions | None = None,
) -> Iterator[list[float | Exception]]:
    """Train one batch after the other; the jobs of a batch train side by side.

    A job's files are the same, bit for bit, as if it were trained alone. Only the wall times in
    ``summary.json`` differ: they are those of the whole batch.

    Args:
        batches: the batches. The jobs of a batch differ only in the keys of
            `fnnq_torchrl.training.jobs.BATCHABLE`.
        pictures: whether to draw each job's ``learning_curve.png``. Drawing takes longer than some
            runs take to learn.
        loggers: the command's loggers; the caller closes them. By default, new ones are made here,
            and closed at the end.
        interruptions: the object that says when to save and when to end. By default, each batch
            makes one that saves every ``checkpoint.every_s``.

    Yields:
        The results of the jobs of a batch, batch after batch. The result of a failed job is its
        exception; the other batches go on.

    Raises:
        OutOfRange: if the machine lacks a device; raised before any batch begins.
        ConfigError: if a batch needs more memory than is free, a saved training is damaged or
            belongs to other jobs, or a logger lacks its library or its login; raised before any
            batch begins. Later, if an engine must compile, and the compiler is missing or fails.
        Interrupted: if a signal has ended the work, and the work is saved. After a signal while
            files are written or logged, the results of that batch are yielded first.
        Lost: if a signal has ended the work, and the work couldn't be saved.
    """
    if loggers is None:
        with closing(Loggers()) as loggers:
            yield from run_batches(
                batches, pictures=pictures, loggers=loggers, interruptions=interruptions
            )
        return
    several = len(batches) > 1
    prepared = [
        Batch(
            with_imported_labels(with_found_labels(jobs)),
            f"batch {number} of {len(batches)}" * several,
        )
        for number, jobs in enumerate(batches, start=1)
    ]
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
            except Exception as error:  # a bug or a lack of memory: other batches may succeed
                results = [error] * len(batch.jobs)
            # Only jobs with a result have files. Some loggers work in one thread only.
            for job, result in zip(batch.jobs, results, strict=True):
                if isinstance(result, float):
                    loggers.log_job(job)
        yield results
        work.obey()


def _check(batch: Batch) -> None:
    """Refuse a batch that this machine can't train; remove temporary files of killed jobs."""
    config = batch.config
    device = torch.device(config.machine.device)
    found = torch.cuda.device_count()
    if device.type == "cuda" and found <= (device.index or 0):
        allowed = f"a device of this machine, which has {found} CUDA devices"
        raise OutOfRange("machine.device", config.machine.device, allowed)
    if is_own(config.env.kind):
        dtype = getattr(torch, config.machine.dtype)
        check_world(make_world(config.env, [2], seed=0, dtype=dtype, device=device))
    check_own(config)
    if large := check_memory(batch):
        announce(batch.label + large)
    for job in batch.jobs:
        clear_leftovers(job.directory)


def _run_batch(
    batch: Batch, saved: SavedTraining, pictures: bool, interruptions: Interruptions
) -> list[float | Exception]:
    trainer = Trainer(batch.config, batch.runs, batch.engine, batch.start)
    announce(batch.label + batch.engine.why)
    if batch.start is not None and batch.start.told:
        announce(batch.label + batch.start.told)
    for words in (gaps_in_words, sharing_in_words):
        if told := words(batch.config):
            announce(batch.label + told)
    outcome = _train(batch, trainer, saved, interruptions)
    _announce_diverged(batch, outcome)
    _announce_bounded(batch, trainer)
    bounds = accumulate((job.config.num_seeds for job in batch.jobs), initial=0)
    *others, last = zip(batch.jobs, pairwise(bounds), strict=True)

    def write(job_and_bounds: tuple[Job, tuple[int, int]]) -> float | Exception:
        job, (begin, end) = job_and_bounds
        runs = slice(begin, end)
        try:
            ledger = trainer.ledger
            fired = None if ledger.fired is None else ledger.fired[runs]
            return _write(job, outcome.of(runs), ledger.book.pages[:, runs], fired)
        except OSError as error:
            return error
        except ValueError as error:  # a score that is NaN or infinite
            return JobFailed(f"{job.directory}: {error}")

    try:
        with ThreadPoolExecutor(_WRITERS) as pool:  # the threads mostly wait for the disk
            results = [*pool.map(write, others)]
    except RuntimeError:  # the system allows no more threads; each file is written whole again
        results = [*map(write, others)]
    # The last job's directory holds training.pt. If another job fails, the last one stays
    # unfinished, so that a restart finds training.pt.
    unwritten = next((result for result in results if isinstance(result, OSError)), None)
    results.append(unwritten or write(last))
    if isinstance(results[-1], OSError):
        with suppress(OSError):  # probably for the same reason; the earlier save stays
            saved.save(trainer.ledger, [])
    # Last, and in this thread, since Matplotlib isn't thread-safe.
    for (job, (begin, end)), result in zip([*others, last], results, strict=True):
        if isinstance(result, float):
            if pictures:
                draw_job(job, outcome.of(slice(begin, end)))
            if job.config.logger.video:
                draw_video(job)
    if not isinstance(results[-1], OSError):
        saved.discard()
    return results


def _train(
    batch: Batch, trainer: Trainer, saved: SavedTraining, interruptions: Interruptions
) -> Outcome:
    """Train and test the runs, from their saved state if any; save at intervals and signals."""
    if saved.restore(trainer.ledger):
        announce(f"{batch.label}going on from {saved.path}")
    told = set()

    def save(hands: Sequence[Hand]) -> None:
        try:
            saved.save(trainer.ledger, hands)
        except OSError as error:
            if not (interruptions.ending or str(error) in told):
                told.add(str(error))
                what = "going on, but this training can't be saved, for now"
                announce(f"{batch.label}{what}: {error}")
            raise

    keeper = HandsKeeper(interruptions, save)
    with interruptions.watched():
        with Progress(trainer.situations_to_learn, f"{batch.label}learning") as progress:
            trainer.learn(progress.update, keeper)
        with Progress(trainer.situations_to_play, f"{batch.label}evaluating") as progress:
            outcome = trainer.evaluate(progress.update, keeper)
        keeper.finish()
    return outcome


def _write(job: Job, outcome: Outcome, pages: TensorDictBase, fired: Tensor | None) -> float:
    directory, config = job.directory, job.config
    for name in (
        "summary.json",
        SNAPSHOTS,
        FIRING,
        SOLVED,
        PICTURE,
        VIDEO,
    ):  # files of earlier runs
        (directory / name).unlink(missing_ok=True)
    settings = asdict(config)
    del settings["logger"]  # no weight depends on it; its library may be missing
    weights, runs = pages["weights"], (outcome.seed, outcome.lam, settings)
    save_checkpoint(directory / "checkpoint.pt", weights[-1], *runs)
    if config.checkpoint.snapshots:
        save_snapshots(directory / SNAPSHOTS, weights, outcome.situations, *runs)
    if fired is not None:
        variables = partition(config.value, config.env)
        write_firing(directory / FIRING, outcome.seed.tolist(), fired, variables)
    if is_watched(pages):
        write_solved(directory / SOLVED, outcome.seed, outcome.situations, pages)
    write_evaluations(directory / "evaluations.csv", outcome)
    summary = summarise(outcome, Score.of(config).bounds)
    write_summary(directory / "summary.json", summary)
    return summary["mean_score"]


def _announce_diverged(batch: Batch, outcome: Outcome) -> None:
    """Print a line with the seeds of the diverged runs, if there are any."""
    if not outcome.diverged_runs:
        return
    diverged = outcome.diverged[:, -1].nonzero()[0].tolist()
    seeds = [str(outcome.seed[run]) for run in diverged[:_NAMED]]
    if len(batch.jobs) > 1:  # runs of different jobs may have the same seed
        job_of = [job for job in batch.jobs for _ in range(job.config.num_seeds)]
        names = [job_of[run].directory.name for run in diverged[:_NAMED]]
        seeds = [f"{seed} of job {name}" for seed, name in zip(seeds, names, strict=True)]
    named = ", ".join(seeds) + ", …" * (len(diverged) > _NAMED)
    announce(
        f"{batch.label}diverged: {len(diverged):,} of {outcome.runs:,} runs (seed {named}); they "
        "stopped, and have the worst score from then on. A smaller alpha may help"
    )


def _announce_bounded(batch: Batch, trainer: Trainer) -> None:
    """Print a line with the number of runs whose adaptive parameters met their bounds, if any."""
    bounded = trainer.bounded_runs
    if bounded:
        names = ", ".join(batch.config.adaptive_parameters)
        announce(
            f"{batch.label}bounded: in {bounded:,} of {batch.size:,} runs {names} came as close to "
            "its limit as it may; they went on"
        )
