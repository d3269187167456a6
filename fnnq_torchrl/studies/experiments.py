"""The result files of an experiment: a directory with one subdirectory for each of its jobs."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml
from omegaconf.errors import OmegaConfBaseException

from fnnq_torchrl.config.checking import flat, to_config
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.training.results import Evaluations, read_evaluations

HOW_IT_RUNS = (
    "engine",
    "machine.device",
    "resume",
    "checkpoint.every_s",
    "checkpoint.snapshots",
    "rules.count_firing",
)
"""Keys that don't change what is computed."""


class NoResults(ValueError):
    """Results that were asked for are missing; the text is one line that says which."""


@dataclass(frozen=True, eq=False)
class Job:
    """A finished job: its configuration and its results.

    Attributes:
        settings: the settings that the results depend on, by keys such as ``env.speed_mps``.
        evaluations: the evaluations of all its runs.
        config: the whole configuration.
        directory: the directory of the job's files.
    """

    settings: dict[str, Any]
    evaluations: Evaluations
    config: Config
    directory: Path

    @property
    def best(self) -> int | None:
        """The highest possible score, or None where a score doesn't count successes."""
        return self.config.best_score


@dataclass(frozen=True, eq=False)
class Experiment:
    """All jobs of an experiment.

    Args:
        name: its name, as in ``+experiment=name``.
        jobs: at least one, in the order in which they were launched.
    """

    name: str
    jobs: list[Job]

    @cached_property
    def varied(self) -> list[str]:
        """The keys whose values differ between jobs, in the configuration's order."""
        first = self.jobs[0].settings
        return [
            key
            for key in first
            if key not in HOW_IT_RUNS
            and any(job.settings.get(key) != first[key] for job in self.jobs)
        ]

    @property
    def runs(self) -> int:
        """The number of runs of each job, or of the smallest job where they differ."""
        return min(job.evaluations.runs for job in self.jobs)

    def job(self, **settings: Any) -> Job:
        """The job with these settings.

        Raises:
            NoResults: there is none, or there are several.
        """
        return self.job_with(settings)

    def job_with(self, settings: Mapping[str, Any]) -> Job:
        """The job with these settings, whose keys may have groups, such as ``env.speed_mps``.

        Raises:
            NoResults: there is none, or there are several.
        """
        found = [
            job
            for job in self.jobs
            if all(job.settings.get(key) == value for key, value in settings.items())
        ]
        if len(found) != 1:
            words = " ".join(f"{key}={value}" for key, value in settings.items())
            raise NoResults(f"{self.name} has {len(found)} jobs with {words}, not one")
        return found[0]

    def where(self, key: str, value: Any) -> "Experiment":
        """The experiment with only those of its jobs that have this value.

        Raises:
            NoResults: no job has it.
        """
        jobs = [job for job in self.jobs if job.settings.get(key) == value]
        if not jobs:
            raise NoResults(f"{self.name} has no jobs with {key}={value}")
        return Experiment(self.name, jobs)

    def values(self, key: str) -> list[Any]:
        """The different values of a key, in the order of the jobs."""
        return list(dict.fromkeys(job.settings[key] for job in self.jobs))


def read_experiment(directory: Path, name: str) -> Experiment:
    """Return the experiment in a directory. Its jobs are the subdirectories named by numbers.

    Raises:
        NoResults: there is no job, or one hasn't finished.
        OSError: a file can't be read.
        ValueError: a file is damaged.
    """
    numbered = [path for path in directory.iterdir() if path.name.isdecimal()]
    jobs = sorted(numbered, key=lambda path: int(path.name))
    if not jobs:
        raise NoResults(f"{directory} has no jobs")
    if unfinished := [path.name for path in jobs if not _finished(path)]:
        raise NoResults(f"{directory}: job {unfinished[0]} hasn't finished")
    return Experiment(name, [_read_job(path) for path in jobs])


def newest_experiment(root: Path, name: str) -> Experiment:
    """Return the newest sweep of an experiment whose jobs have all finished, ``root/name/<time>``.

    Raises:
        NoResults: there is none.
        OSError, ValueError: as in :func:`read_experiment`.
    """
    for sweep in sorted((root / name).glob("*/"), key=_started, reverse=True):
        jobs = [path for path in sweep.iterdir() if path.name.isdecimal()]
        if jobs and all(map(_finished, jobs)):
            return read_experiment(sweep, name)
    command = f"python -m fnnq_torchrl.train +experiment={name}"
    raise NoResults(f"{root / name} has no finished results: {command}")


def _started(sweep: Path) -> tuple[str, int]:
    """The time in a sweep's directory name, and its number among the sweeps of that second."""
    time, _, number = sweep.name.partition("_")
    clock, _, number = number.partition("_")
    return f"{time}_{clock}", int(number) if number.isdecimal() else 1


def _finished(job: Path) -> bool:
    """Return whether a job has written its summary, which it writes last."""
    return (job / "summary.json").is_file()


def _read_job(directory: Path) -> Job:
    path = directory / ".hydra" / "config.yaml"
    try:
        plain = yaml.safe_load(path.read_bytes())
    except Exception as error:  # a file that isn't YAML can raise nearly anything
        raise ValueError(f"{path} is not a configuration") from error
    if not isinstance(plain, dict):
        raise ValueError(f"{path} is not a configuration")
    try:
        config = to_config(plain, own=False)
    except (ConfigError, OmegaConfBaseException) as error:
        raise ValueError(f"{path}: {str(error).splitlines()[0]}") from error
    settings = asdict(config)
    del settings["logger"]  # each logger has other keys, and none changes the results
    evaluations = read_evaluations(directory / "evaluations.csv", config.env.tested.measure)
    return Job(flat(settings), evaluations, config, directory)
