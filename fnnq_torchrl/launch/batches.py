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
    """Runs the jobs of each batch and yields their results: `.training.job.run_batches`."""

    def __call__(
        self,
        batches: Sequence[Sequence[Job]],
        *,
        pictures: bool,
        loggers: "Loggers | None" = None,
        interruptions: Interruptions | None = None,
    ) -> Iterator[Sequence[Result]]: ...


def in_batches(jobs: Iterable[Job], most_runs: int) -> list[list[Job]]:
    """Share jobs out to batches, each in the jobs' order.

    Args:
        jobs: in any order. Those of one batch differ only in keys of `BATCHABLE`.
        most_runs: the runs that a batch may have. A job isn't split: one with more is a batch of
            its own.
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
    """Return the same text for all jobs that can be in one batch, and for no other."""
    return repr({key: value for key, value in asdict(config).items() if key not in BATCHABLE})
