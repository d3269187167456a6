"""Which jobs of a sweep train side by side, in one batch of runs."""

from collections.abc import Iterable
from dataclasses import asdict

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.jobs import BATCHABLE, Job


def in_batches(jobs: Iterable[Job], most_runs: int) -> list[list[Job]]:
    """Shares jobs out to batches, each in the jobs' order.

    Args:
        jobs: in any order; those that can't be in one batch are not.
        most_runs: of a batch. A job isn't split: one with more runs is a batch of its own.
    """
    batches: list[list[Job]] = []
    open_batches: dict[str, tuple[list[Job], int]] = {}  # the last of each kind, and its runs
    for job in jobs:
        kind, runs = _kind(job.config), job.config.num_seeds
        batch, so_far = open_batches.get(kind, ([], most_runs))
        if so_far + runs > most_runs:
            batch, so_far = [], 0
            batches.append(batch)
        batch.append(job)
        open_batches[kind] = batch, so_far + runs
    return batches


def _kind(config: Config) -> str:
    """The same text for all that can be in one batch, and for no other."""
    return repr({key: value for key, value in asdict(config).items() if key not in BATCHABLE})
