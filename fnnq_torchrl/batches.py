"""Jobs, and which of them can train side by side in one batch of runs."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Protocol

from envs.ranges import Parameters, matching, number, one_of, whole
from fnnq_torchrl.config import PER_RUN, Config, run_columns

BATCHABLE = (*PER_RUN, "num_seeds")
"""The keys in which jobs of one batch may differ; in all others they are equal."""

ASIDE = ("resume", "checkpoint", "logger")
"""The keys on which no result depends: how training is saved and gone on with, and its loggers."""

TRAINING = "training.pt"
"""The file of a training that isn't finished."""

RESULTS = ("checkpoint.pt", "evaluations.csv", "summary.json")
"""The files that every finished job has, the last of them written last."""

SNAPSHOTS = "snapshots.pt"
"""The file with the weights of all evaluations, which a job leaves if it is to."""


@dataclass(frozen=True)
class Job:
    """What to train, and the directory for what it writes; that of its sweep, if there is one."""

    config: Config
    directory: Path
    sweep: Path | None = None


class JobFailed(Exception):
    """A job that ended without its result; the text is one line that says why."""


Result = float | Exception | None
"""Of a job: its objective, which training has, or why there is none."""


class RunBatches(Protocol):
    """Runs the jobs of each batch, and yields their results: `fnnq_torchrl.job.run_batches`."""

    def __call__(
        self, batches: Sequence[Sequence[Job]], *, pictures: bool
    ) -> Iterator[Sequence[Result]]: ...


@dataclass
class LauncherConfig(Parameters):
    """The settings of the launcher; values and their meaning: conf/hydra/launcher/batch.yaml."""

    max_batch_size: int = whole(1)
    pictures_up_to: int = whole(0)
    cluster: str = one_of("none", "local", "slurm")
    partition: str = matching(r"[\w,-]*", "the name of a partition, or several with commas")
    time_min: int = whole(1)
    memory_gb: float = number(above=0)
    cpus: int = whole(1)
    gpus: int = whole(0)


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


def as_one(configs: Sequence[Config]) -> tuple[Config, dict[str, list[float]]]:
    """The jobs of one batch as a single one.

    Args:
        configs: equal but for `BATCHABLE`, at least one.

    Returns:
        A configuration with as many runs as all have together, and the columns of those runs, one
        job's after the other's: by each key of `PER_RUN` a list of values.
    """
    runs = sum(config.num_seeds for config in configs)
    of_each = [run_columns(config) for config in configs]
    columns = {key: [value for of in of_each for value in of[key]] for key in PER_RUN}
    # Its own seed is one of many, and must leave room for as many more as there are runs.
    return replace(configs[0], seed=0, num_seeds=runs), columns
