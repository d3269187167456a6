"""The results that loggers get, and the interface that every logger has."""

import os
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fnnq_torchrl.config.schema import PER_RUN
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
from fnnq_torchrl.training.score import Score

_TABLES = ("evaluations.csv", "summary.json", "summary.csv")


class Results:
    """The files of a job or of a sweep.

    Args:
        directory: that of the job or of the sweep.
        home: the directory of the sweep or, for a job without one, its own.
        name: the name under which it is logged.
    """

    def __init__(self, directory: Path, home: Path, name: str) -> None:
        self.directory, self.home, self.name = directory, home, name

    @property
    def group(self) -> str:
        """The name that a sweep shares with its jobs."""
        return self.home.name

    @property
    def pictures(self) -> list[Path]:
        """Its pictures."""
        return sorted(self.directory.glob("*.png"))

    @property
    def tables(self) -> list[Path]:
        """The files with its numbers."""
        return [path for name in _TABLES if (path := self.directory / name).exists()]


class JobResults(Results):
    """A finished job, whose files are read when a property first needs them.

    Args:
        job: the job. It is logged as ``<sweep>/<job>`` or, without a sweep, by its directory's
            name.

    Raises:
        OSError, ValueError: by the properties, if a file can't be read or is damaged.
    """

    def __init__(self, job: Job) -> None:
        home = job.sweep or job.directory
        super().__init__(job.directory, home, os.path.relpath(job.directory, home.parent))
        self.job = job
        self._score = Score.of(job.config)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The configuration, nested, without the loggers' settings."""
        settings = asdict(self.job.config)
        del settings["logger"]
        return settings

    @cached_property
    def evaluations(self) -> Evaluations:
        """The content of evaluations.csv."""
        return read_evaluations(self.directory / "evaluations.csv", self._score.measure)

    @cached_property
    def summary(self) -> Summary:
        """The content of summary.json."""
        return read_summary(self.directory / "summary.json")

    @property
    def scores(self) -> dict[str, float]:
        """The summary's mean scores over the runs."""
        return {key: self.summary[key] for key in ("mean_score", "final_score")}

    @cached_property
    def curve(self) -> dict[str, list[float]]:
        """The learning curve in columns with one number for each evaluation.

        ``steps``, the learning steps of a run so far, and ``score`` are means over the runs.
        ``score_low`` and ``score_high`` are the bounds of the score's interval (see
        `mean_interval`), which a single run doesn't have. ``diverged`` is the number of runs that
        have diverged.
        """
        evaluations = self.evaluations
        mean, low, high = mean_interval(
            evaluations.score, confidence=CONFIDENCE, bounds=self._score.bounds
        )
        columns = {
            "steps": evaluations.steps.mean(axis=0),
            "score": mean,
            "diverged": evaluations.diverged.sum(axis=0),
        }
        if evaluations.runs > 1:
            columns |= {"score_low": low, "score_high": high}
        return {name: column.tolist() for name, column in columns.items()}

    def columns(self, run: int) -> dict[str, list[float]]:
        """Return the columns of evaluations.csv that change within a run, for one run.

        Flags are 0 and 1, since loggers draw curves of numbers only.
        """
        shape = self.evaluations.steps.shape
        return {
            name: (np.broadcast_to(self.evaluations.column(name), shape)[run] + 0).tolist()
            for name in EVALUATION_COLUMNS
            if name not in PER_RUN
        }


class SweepResults(Results):
    """A sweep after its last job; some jobs may have failed.

    Args:
        directory: that of the sweep, with the files over all jobs.
        jobs: all jobs.
    """

    def __init__(self, directory: Path, jobs: Sequence[Job]) -> None:
        super().__init__(directory, directory, f"{directory.name}: {len(jobs):,} jobs")
        self.jobs = jobs


class Logger(ABC):
    """A place where finished jobs are logged. `Loggers` handles any error of its methods."""

    def prepare(self, jobs: Sequence[Job]) -> None:  # noqa: B027  # most have nothing to say
        """Tell the user, before these jobs begin, what to expect of logging them."""

    @abstractmethod
    def log_job(self, job: JobResults) -> None:
        """Log one job."""

    @abstractmethod
    def log_sweep(self, sweep: SweepResults) -> None:
        """Log a sweep without its jobs."""

    def close(self) -> None:  # noqa: B027  # most have nothing to do
        """Wait for work in the background, at the end of the command or after a failure."""
