"""Jobs, and which of them can train side by side in one batch of runs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from fnnq_torchrl.config.schema import PER_RUN, Config, run_columns

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
    """Runs the jobs of each batch, and yields their results: `.job.run_batches`."""

    def __call__(
        self, batches: Sequence[Sequence[Job]], *, pictures: bool
    ) -> Iterator[Sequence[Result]]: ...


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
