"""The batches of a sweep: jobs that train side by side."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Protocol

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.jobs import BATCHABLE, Job, Result
from fnnq_torchrl.training.resume.interruptions import Interruptions

if TYPE_CHECKING:
    from fnnq_torchrl.training.loggers import Loggers


class RunBatches(Protocol):
    """The type of `fnnq_torchrl.training.job.run_batches`, which trains the jobs of batches."""

    def __call__(
        self,
        batches: Sequence[Sequence[Job]],
        *,
        pictures: bool,
        loggers: "Loggers | None" = None,
        interruptions: Interruptions | None = None,
    ) -> Iterator[Sequence[Result]]: ...


def in_batches(jobs: Iterable[Job], most_runs: int) -> list[list[Job]]:
    """Group jobs into batches; each batch keeps the order of its jobs.

    Args:
        jobs: the jobs, in any order. Two jobs may share a batch if they differ only in keys of
            `BATCHABLE`.
        most_runs: the most runs in a batch. A job is never split; a job with more runs than this
            is a batch by itself.
    """
    batches: list[list[Job]] = []
    open_batches: dict[str, tuple[list[Job], int]] = {}  # by kind: last batch, number of runs
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
    """Return a text that two jobs share exactly if they can be in one batch."""
    return repr({key: value for key, value in asdict(config).items() if key not in BATCHABLE})
