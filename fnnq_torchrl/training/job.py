"""Jobs, from their configurations to the files of their output directories."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from itertools import accumulate, pairwise
from pathlib import Path

import torch
from tensordict import TensorDictBase

from fnnq_torchrl.config.schema import Config, ConfigError, OutOfRange
from fnnq_torchrl.engine.choice import choose, make_engine
from fnnq_torchrl.files.atomic import clear_leftovers
from fnnq_torchrl.training.checkpoint import save_checkpoint
from fnnq_torchrl.training.jobs import SNAPSHOTS, TRAINING, Job, as_one
from fnnq_torchrl.training.loggers import Loggers
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
from fnnq_torchrl.training.snapshot_file import save_snapshots
from fnnq_torchrl.training.terminal import Progress, announce, print_summary
from fnnq_torchrl.training.trainer import Trainer

PICTURE = "learning_curve.png"
"""The file with the learning curve."""

_WRITERS = 8
"""Threads that write files of different jobs."""

_NAMED = 5
"""Diverged runs that are named; the others are counted."""


def run_job(config: Config, directory: Path) -> float:
    """Train all runs of a job and say what came of it.

    Leaves ``checkpoint.pt``, ``snapshots.pt`` if it is to, ``evaluations.csv``,
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
    # Whatever signal came while the files were written: there is nothing left to be interrupted.
    [result] = next(run_batches([[Job(config, directory)]], pictures=True))
    if isinstance(result, Exception):
        raise result
    print_summary(read_summary(directory / "summary.json"), directory / PICTURE)
    return result


def run_batches(
    batches: Sequence[Sequence[Job]], *, pictures: bool
) -> Iterator[list[float | Exception]]:
    """Train the jobs of each batch side by side.

    A job leaves the files that it would leave alone, the same bit for bit but for the wall times
    in ``summary.json``, which are its batch's.

    Args:
        batches: of jobs that are equal but for `fnnq_torchrl.training.jobs.BATCHABLE`.
        pictures: whether each job gets its ``learning_curve.png``; they take longer to draw than
            many a run takes to learn.

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
    for batch in batches:
        _check_machine(batch[0].config)
        large = check_memory(batch[0].config, sum(job.config.num_seeds for job in batch))
        if large:
            announce(large)
        for job in batch:
            clear_leftovers(job.directory)
    for batch in batches:
        _check_saved(batch)
    for batch, loggers in [*zip(batches, _loggers(batches), strict=True)]:
        results: list[float | Exception]
        with Interruptions(batch[0].config.checkpoint.every_s) as interruptions:
            try:
                results = _run_batch(batch, pictures, interruptions)
            except (ConfigError, Interrupted):
                raise
            except Exception as error:  # a bug, or too little memory: the other batches may do
                results = [error] * len(batch)
            # Of jobs whose files are there, and in this thread: not all loggers know of others.
            logged = zip(batch, results, strict=True)
            loggers.log_jobs(job for job, result in logged if isinstance(result, float))
        yield results
        interruptions.obey()


def _loggers(batches: Sequence[Sequence[Job]]) -> list[Loggers]:
    """Of each batch; batches with the same configuration of it share theirs."""
    of_each = [repr(batch[0].config.logger) for batch in batches]
    jobs: dict[str, list[Job]] = {key: [] for key in of_each}
    for key, batch in zip(of_each, batches, strict=True):
        jobs[key] += batch
    made = {key: Loggers.of(of[0].config.logger) for key, of in jobs.items()}
    for key, loggers in made.items():
        loggers.foresee(jobs[key])
    return [made[key] for key in of_each]


def _check_machine(config: Config) -> None:
    device = config.machine.device
    _, _, index = device.partition("cuda:")
    if device != "cpu" and torch.cuda.device_count() <= int(index or 0):
        found = torch.cuda.device_count()
        raise OutOfRange("machine.device", device, f"there: this machine has {found} CUDA devices")
    engine, _ = choose(config)
    make_engine(engine, torch.device(device))


def _check_saved(jobs: Sequence[Job]) -> None:
    """Refuse, before anything is computed, a saved training that can't be gone on from."""
    if jobs[0].config.resume == "auto" and (jobs[-1].directory / TRAINING).exists():
        trainer = Trainer(*as_one([job.config for job in jobs]))
        _saved(jobs, trainer).load(trainer)


def _saved(jobs: Sequence[Job], trainer: Trainer) -> SavedTraining:
    return SavedTraining(jobs[-1].directory, trainer.config, trainer.engine.name)


def _run_batch(
    jobs: Sequence[Job], pictures: bool, interruptions: Interruptions
) -> list[float | Exception]:
    trainer = Trainer(*as_one([job.config for job in jobs]))
    announce(trainer.engine_chosen)
    saved = _saved(jobs, trainer)
    outcome = _train(trainer, saved, interruptions)
    _announce_diverged(outcome)
    _announce_denormal(outcome)
    bounds = accumulate((job.config.num_seeds for job in jobs), initial=0)
    *others, last = zip(jobs, pairwise(bounds), strict=True)

    def write(job_and_bounds: tuple[Job, tuple[int, int]]) -> float | Exception:
        job, (begin, end) = job_and_bounds
        runs = slice(begin, end)
        try:
            return _write(job, outcome.of(runs), trainer.ledger.book.pages[:, runs], pictures)
        except OSError as error:
            return error

    # Mostly the disk is waited for; but Matplotlib knows one thread only.
    with ThreadPoolExecutor(1 if pictures else _WRITERS) as pool:
        results = [*pool.map(write, others)]
    # The last, where the training is saved, is finished only after all others that can be: whoever
    # computes again what is missing goes on from there.
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
    if trainer.config.resume == "auto" and saved.load(trainer):
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


def _write(job: Job, outcome: Outcome, pages: TensorDictBase, pictures: bool) -> float:
    directory, config = job.directory, job.config
    evaluations = directory / "evaluations.csv"
    for name in ("summary.json", SNAPSHOTS, PICTURE):  # an earlier one isn't of these files
        (directory / name).unlink(missing_ok=True)
    settings = asdict(config)
    del settings["logger"]  # which has no say in the weights, and may not be there where they go
    weights, runs = pages["weights"], (outcome.seed, outcome.lam, settings)
    save_checkpoint(directory / "checkpoint.pt", weights[-1], *runs)
    if config.checkpoint.snapshots:
        save_snapshots(directory / SNAPSHOTS, weights, outcome.situations, *runs)
    write_evaluations(evaluations, outcome)
    if pictures:
        learning_curve(evaluations, directory / PICTURE, best=len(config.evaluation.situations))
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


def _announce_denormal(outcome: Outcome) -> None:
    """One line, if runs have learned subnormal weights."""
    if not outcome.denormal_runs:
        return
    seeds = outcome.seed[outcome.denormal[:, -1]].tolist()
    announce(
        f"denormal: {len(seeds):,} of {outcome.runs:,} runs (seed {_some(seeds)}) have weights too "
        "small for full precision. machine.dtype=float64 has smaller numbers"
    )


def _some(seeds: list[int]) -> str:
    return ", ".join(map(str, seeds[:_NAMED])) + ", …" * (len(seeds) > _NAMED)
