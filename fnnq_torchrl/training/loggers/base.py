"""What a logger gets, and what it must be able to do."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.config.schema import PER_RUN, run_columns
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.results import (
    CONFIDENCE,
    EVALUATION_COLUMNS,
    Evaluations,
    Summary,
    read_evaluations,
    read_summary,
)

_CHANGING = [name for name in EVALUATION_COLUMNS if name not in PER_RUN]
"""The columns of evaluations.csv that change from row to row of a run: whole numbers, flags."""


@dataclass(frozen=True)
class JobResults:
    """A finished job, read from its files when it is asked for.

    Raises:
        OSError, ValueError: by its properties, if a file can't be read or is damaged.
    """

    job: Job

    @property
    def directory(self) -> Path:
        """With the result files."""
        return self.job.directory

    @property
    def group(self) -> str:
        """What its sweep is called or, for a job alone, the job itself."""
        return (self.job.sweep or self.directory).name

    @property
    def name(self) -> str:
        """What it is called among all jobs: ``<sweep>/<job>``, or as its directory."""
        sweep = self.job.sweep
        if sweep is None or not self.directory.is_relative_to(sweep):
            return self.directory.name
        return str(self.directory.relative_to(sweep.parent))

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The configuration, nested, without that of the loggers."""
        settings = asdict(self.job.config)
        del settings["logger"]
        return settings

    @cached_property
    def runs(self) -> dict[str, list[float]]:
        """The values in which the runs may differ, by their keys: each ``[runs]``."""
        return run_columns(self.job.config)

    @cached_property
    def evaluations(self) -> Evaluations:
        """What evaluations.csv holds."""
        return read_evaluations(self.directory / "evaluations.csv")

    @cached_property
    def summary(self) -> Summary:
        """What summary.json holds."""
        return read_summary(self.directory / "summary.json")

    def rows(self, run: int) -> Iterator[dict[str, int]]:
        """A run's rows of evaluations.csv, without what is the same in all of them."""
        evaluations = self.evaluations
        shape = evaluations.runs, evaluations.situations.size
        columns = [
            # Numbers all, of which loggers can draw curves.
            np.broadcast_to(getattr(evaluations, name), shape)[run].astype(np.int64).tolist()
            for name in _CHANGING
        ]
        for row in zip(*columns, strict=True):
            yield dict(zip(_CHANGING, row, strict=True))

    @property
    def scores(self) -> dict[str, float]:
        """Of the summary, the means over the runs."""
        return {key: self.summary[key] for key in ("mean_score", "final_score")}

    @property
    def pictures(self) -> list[Path]:
        """Everything that was drawn of it."""
        return sorted(self.directory.glob("*.png"))

    @property
    def tables(self) -> list[Path]:
        """The files with the numbers."""
        return [self.directory / name for name in ("evaluations.csv", "summary.json")]

    @cached_property
    def curve(self) -> dict[str, NDArray[np.float64]]:
        """The learning curve in columns, each ``[evaluations]``.

        ``steps``, the learning steps of a run so far, and ``score``, its catches, are means over
        the runs; ``score_low`` and ``score_high``, which a single run doesn't have, the bounds of
        the score's interval (Student's t). ``diverged`` is how many runs have.
        """
        evaluations = self.evaluations
        mean, low, high = mean_interval(evaluations.catches, confidence=CONFIDENCE)
        columns = {
            "steps": evaluations.steps.mean(axis=0),
            "score": mean,
            "diverged": evaluations.diverged.sum(axis=0, dtype=np.float64),
        }
        return (
            columns if evaluations.runs == 1 else columns | {"score_low": low, "score_high": high}
        )


@dataclass(frozen=True)
class SweepResults:
    """A sweep whose jobs are finished as far as they will be.

    Attributes:
        directory: with the files over all jobs.
        jobs: how many there are.
    """

    directory: Path
    jobs: int

    @property
    def pictures(self) -> list[Path]:
        """Everything that was drawn of the sweep."""
        return sorted(self.directory.glob("*.png"))

    @property
    def tables(self) -> list[Path]:
        """The files with the numbers, as far as there are any."""
        paths = [self.directory / name for name in ("evaluations.csv", "summary.csv")]
        return [path for path in paths if path.exists()]


class Logger(ABC):
    """Takes down what came of finished jobs. May fail with any exception: see `Loggers`."""

    def foresee(self, jobs: Sequence[Job]) -> None:  # noqa: B027  # most have nothing to say
        """Say in a line, before these jobs begin, what the user should know by then."""

    @abstractmethod
    def log_job(self, job: JobResults) -> None:
        """Log one job."""

    @abstractmethod
    def log_sweep(self, sweep: SweepResults) -> None:
        """Log what there is of a sweep besides its jobs."""

    def close(self) -> None:  # noqa: B027  # most have nothing to do
        """Finish what goes on in the background, at the end of the process."""
