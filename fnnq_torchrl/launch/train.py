"""The train command, and the functions by which it trains a job or batches of jobs."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.command import command
from fnnq_torchrl.launch.imports import uncollected
from fnnq_torchrl.training.jobs import Job, Result
from fnnq_torchrl.training.resume.interruptions import Interruptions

if TYPE_CHECKING:
    from fnnq_torchrl.training.loggers import Loggers


def train(config: Config, directory: Path) -> float:
    """Train the runs of a job, write its results into ``directory``, and return its mean score."""
    _check_files([config])
    with uncollected():  # after the checks: torch takes seconds to import
        from fnnq_torchrl.training.job import run_job

    return run_job(config, directory)


def train_batches(
    batches: Sequence[Sequence[Job]],
    *,
    pictures: bool,
    loggers: "Loggers | None" = None,
    interruptions: Interruptions | None = None,
) -> Iterator[Sequence[Result]]:
    """Train the jobs of each batch of a multirun side by side."""
    _check_files([job.config for batch in batches for job in batch])
    with uncollected():
        from fnnq_torchrl.training.job import run_batches

    return run_batches(batches, pictures=pictures, loggers=loggers, interruptions=interruptions)


def _check_files(configs: Iterable[Config]) -> None:
    """Refuse a configuration that names missing files; training would, too, but after seconds."""
    for config in configs:
        if config.rules is not None:
            config.rules.files()


main = command(train, train_batches)
