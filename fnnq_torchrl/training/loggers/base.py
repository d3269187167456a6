"""The results that are passed to loggers, and the interface of loggers."""

import os
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.jobs import VIDEO, Job
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
    """The result files of a job or of a sweep.

    Args:
        directory: the directory of the job or of the sweep.
        home: the directory of the sweep; for a job without a sweep, the job's directory.
        name: the name under which the job or sweep is logged.
    """

    def __init__(self, directory: Path, home: Path, name: str) -> None:
        self.directory, self.home, self.name = directory, home, name

    @property
    def group(self) -> str:
        """The name of the group that a sweep and its jobs are logged in."""
        return self.home.name

    @property
    def pictures(self) -> list[Path]:
        """The paths of the pictures."""
        return sorted(self.directory.glob("*.png"))

    @property
    def video(self) -> Path | None:
        """The path of the video of the robot; None if there is none."""
        return None

    @property
    def tables(self) -> list[Path]:
        """The paths of the result files with numbers, those that exist."""
        return [path for name in _TABLES if (path := self.directory / name).exists()]


class JobResults(Results):
    """The results of a finished job; a file is read when a property first needs it.

    Args:
        job: the job. It is logged as ``<sweep>/<job>`` or, without a sweep, under the name of its
            directory.

    Raises:
        OSError: by a property, if a file can't be read.
        ValueError: by a property, if a file is damaged.
    """

    def __init__(self, job: Job) -> None:
        home = job.sweep or job.directory
        super().__init__(job.directory, home, os.path.relpath(job.directory, home.parent))
        self.job = job
        self._score = Score.of(job.config)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The configuration as nested dictionaries, without the loggers' settings."""
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
    def video(self) -> Path | None:
        path = self.directory / VIDEO
        return path if self.job.config.logger.video and path.exists() else None

    @property
    def scores(self) -> dict[str, float]:
        """``mean_score`` and ``final_score`` of the summary, both means over the runs."""
        return {key: self.summary[key] for key in ("mean_score", "final_score")}

    @cached_property
    def curve(self) -> dict[str, list[float]]:
        """The learning curve: columns by name, each with one number per evaluation.

        * ``steps``: the learning steps so far, mean over the runs;
        * ``score``: the score, mean over the runs;
        * ``diverged``: the number of runs that have diverged;
        * ``score_low``, ``score_high``: the bounds of the confidence interval of ``score`` (see
          `mean_interval`); left out for a single run.
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
        """Return the columns of evaluations.csv for one run, without its seed and its λ.

        Flags are 0 and 1, since loggers draw curves of numbers only. A column without any number,
        such as the temperature of runs that have none, is left out.
        """
        shape = self.evaluations.steps.shape
        columns = {
            name: np.broadcast_to(self.evaluations.column(name), shape)[run] + 0
            for name in EVALUATION_COLUMNS
            if name not in ("seed", "lam")
        }
        return {
            name: column.tolist() for name, column in columns.items() if not np.isnan(column).all()
        }


class SweepResults(Results):
    """The results of a sweep after its last job; some jobs may have failed.

    Args:
        directory: the directory of the sweep, with the files that cover all jobs.
        jobs: all jobs of the sweep.
    """

    def __init__(self, directory: Path, jobs: Sequence[Job]) -> None:
        super().__init__(directory, directory, f"{directory.name}: {len(jobs):,} jobs")
        self.jobs = jobs


class Logger(ABC):
    """The interface of a logger. Methods may raise any error; `Loggers` handles it."""

    def prepare(self, jobs: Sequence[Job]) -> None:  # noqa: B027  # most have nothing to say
        """Print, before these jobs begin, what the user should know about logging them."""

    @abstractmethod
    def log_job(self, job: JobResults) -> None:
        """Log one job."""

    @abstractmethod
    def log_sweep(self, sweep: SweepResults) -> None:
        """Log the files of a sweep as a whole; its jobs are logged by :meth:`log_job`."""

    def close(self) -> None:  # noqa: B027  # most have nothing to do
        """Wait until background work is done; called once, at the end of the command."""
