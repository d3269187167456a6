"""The result files of an experiment: a directory with one subdirectory for each of its jobs."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf.errors import OmegaConfBaseException

from fnnq_torchrl.config.checking import flat, to_config
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.files.settings import parse_settings
from fnnq_torchrl.training.results import Evaluations, read_evaluations

HOW_IT_RUNS = (
    "engine",
    "machine.device",
    "resume",
    "checkpoint.every_s",
    "checkpoint.snapshots",
    "rules.count_firing",
)
"""Keys of the configuration that don't change a job's results."""


class NoResults(ValueError):
    """Results are missing or can't be compared; the message is one line that says which."""


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
        """The highest possible score, or None if the score doesn't count successes."""
        return self.config.best_score


@dataclass(frozen=True, eq=False)
class Experiment:
    """All jobs of an experiment.

    Args:
        name: the name of the experiment, as in ``+experiment=name``.
        jobs: at least one, in the order in which they were launched.
    """

    name: str
    jobs: list[Job]

    @cached_property
    def varied(self) -> list[str]:
        """The keys whose values differ between jobs, in the configuration's order.

        Keys in `HOW_IT_RUNS` are left out.
        """
        first = self.jobs[0].settings
        return [
            key
            for key in first
            if key not in HOW_IT_RUNS
            and any(job.settings.get(key) != first[key] for job in self.jobs)
        ]

    @property
    def runs(self) -> int:
        """The number of runs of the smallest job."""
        return min(job.evaluations.runs for job in self.jobs)

    def job(self, **settings: Any) -> Job:
        """The only job with these settings.

        Raises:
            NoResults: if no job or more than one has these settings.
        """
        return self.job_with(settings)

    def job_with(self, settings: Mapping[str, Any]) -> Job:
        """The only job with these settings, by full keys such as ``env.speed_mps``.

        Raises:
            NoResults: if no job or more than one has these settings.
        """
        found = [
            job
            for job in self.jobs
            if all(job.settings.get(key) == value for key, value in settings.items())
        ]
        if len(found) != 1:
            words = " ".join(f"{key}={value}" for key, value in settings.items())
            raise NoResults(f"{self.name} has {len(found)} jobs with {words}; it must have one")
        return found[0]

    def where(self, key: str, value: Any) -> "Experiment":
        """A new experiment with the jobs that have this value of the key.

        Raises:
            NoResults: if no job has the value.
        """
        jobs = [job for job in self.jobs if job.settings.get(key) == value]
        if not jobs:
            raise NoResults(f"{self.name} has no jobs with {key}={value}")
        return Experiment(self.name, jobs)

    def values(self, key: str) -> list[Any]:
        """The distinct values of a key, in the order of the jobs."""
        return list(dict.fromkeys(job.settings[key] for job in self.jobs))


def read_experiment(directory: Path, name: str) -> Experiment:
    """Return the experiment in a directory. Its jobs are the subdirectories named by numbers.

    Raises:
        NoResults: if there is no job, or a job hasn't finished.
        OSError: if a file can't be read.
        ValueError: if a file is damaged.
    """
    numbered = [path for path in directory.iterdir() if path.name.isdecimal()]
    jobs = sorted(numbered, key=lambda path: int(path.name))
    if not jobs:
        raise NoResults(f"{directory} has no jobs")
    if unfinished := [path.name for path in jobs if not _finished(path)]:
        raise NoResults(f"{directory}: job {unfinished[0]} hasn't finished")
    return Experiment(name, [read_job(path) for path in jobs])


def newest_experiment(root: Path, name: str) -> Experiment:
    """Return the newest finished sweep of an experiment, from a directory ``root/name/<time>``.

    A sweep is finished if all its jobs are.

    Raises:
        NoResults: if no sweep is finished.
        OSError, ValueError: as in :func:`read_experiment`.
    """
    for sweep in sorted((root / name).glob("*/"), key=_started, reverse=True):
        jobs = [path for path in sweep.iterdir() if path.name.isdecimal()]
        if jobs and all(map(_finished, jobs)):
            return read_experiment(sweep, name)
    command = f"python -m fnnq_torchrl.train +experiment={name}"
    raise NoResults(f"{root / name} has no finished results: {command}")


def _started(sweep: Path) -> tuple[str, int]:
    """Return the start time and the number, from 1, of a sweep among the sweeps of one second.

    Both are read from the sweep's directory name.
    """
    time, _, number = sweep.name.partition("_")
    clock, _, number = number.partition("_")
    return f"{time}_{clock}", int(number) if number.isdecimal() else 1


def _finished(job: Path) -> bool:
    """Return True if a job has written ``summary.json``, which is its last file."""
    return (job / "summary.json").is_file()


def read_job(directory: Path, *, own: bool = False) -> Job:
    """Return a finished job.

    Args:
        directory: the job's directory.
        own: True to import the user's own classes that the configuration names.

    Raises:
        OSError: if a file can't be read.
        ValueError: if a file is damaged, or the configuration isn't valid; the message is one line.
    """
    path = directory / ".hydra" / "config.yaml"
    plain = parse_settings(path.read_bytes())
    if plain is None:
        raise ValueError(f"{path} is not a configuration")
    try:
        config = to_config(plain, own=own)
    except (ConfigError, OmegaConfBaseException) as error:
        raise ValueError(f"{path}: {str(error).splitlines()[0]}") from error
    settings = asdict(config)
    del settings["logger"]  # each logger has other keys, and none changes the results
    evaluations = read_evaluations(directory / "evaluations.csv", config.env.tested.measure)
    return Job(flat(settings), evaluations, config, directory)
