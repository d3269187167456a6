"""The finished jobs below some directories, by configuration, each run once."""

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fnnq_torchrl.config.identity import ASIDE, WHICH_RUNS, JobRuns, RunsSoFar
from fnnq_torchrl.studies.experiments import Job, NoResults, read_job
from fnnq_torchrl.training.pictures.words import setting_words
from fnnq_torchrl.training.results import Evaluations
from fnnq_torchrl.training.score import Score

_CONFIGURATION = Path(".hydra", "config.yaml")
_LONGEST = 60


@dataclass(frozen=True, eq=False)
class Part:
    """A finished job, with the seeds of the runs that no earlier job has."""

    job: Job
    seeds: list[int]

    @cached_property
    def evaluations(self) -> Evaluations:
        """The evaluations of the runs with these seeds."""
        return self.job.evaluations.of(np.isin(self.job.evaluations.seed, self.seeds))


@dataclass(frozen=True, eq=False)
class Configuration:
    """The runs of all jobs that have the same configuration but for the seeds.

    Attributes:
        parts: the jobs, at least one, each with its new runs; at least the first has some.
    """

    parts: list[Part]

    @property
    def job(self) -> Job:
        """The first job with this configuration."""
        return self.parts[0].job

    @cached_property
    def evaluations(self) -> Evaluations:
        """The evaluations of all runs, each once, in the order of the jobs."""
        return Evaluations.joined([part.evaluations for part in self.parts if part.seeds])

    @property
    def score(self) -> Score:
        """The score of the configuration's tests."""
        return Score.of(self.job.config)


@dataclass(frozen=True, eq=False)
class Results:
    """The results below some directories.

    Attributes:
        configurations: at least one, in the order in which their jobs are found.
        left_out: a line for each job that can't be read, with the reason.
        repeated: the number of runs that repeat a run of an earlier job, and aren't counted.
    """

    configurations: list[Configuration]
    left_out: list[str]
    repeated: int

    @cached_property
    def varied(self) -> list[str]:
        """The keys in which the configurations differ, in the configuration's order.

        Keys that only some kinds of world or value function have are left out if the kinds differ.
        """
        settings = [configuration.job.settings for configuration in self.configurations]
        return [
            key
            for key in settings[0]
            if key.partition(".")[0] not in (*WHICH_RUNS, *ASIDE)
            and all(key in each for each in settings)
            and len({repr(each[key]) for each in settings}) > 1
        ]

    def label(self, configuration: Configuration) -> str:
        """Return in words how a configuration differs from the others.

        A single configuration is called by its λ, and one like another by its job, too.
        """
        words = self._words(configuration)
        if sum(self._words(each) == words for each in self.configurations) > 1:
            return f"{words} ({configuration.job.directory.name})"
        return words

    def _words(self, configuration: Configuration) -> str:
        settings = configuration.job.settings
        words = (setting_words(key, settings[key]) for key in self.varied or ["lam"])
        return ", ".join(each if len(each) <= _LONGEST else f"{each[:_LONGEST]}…" for each in words)


def collect(directories: Sequence[Path], *, own: bool = False) -> Results:
    """Return the results of all finished jobs in directories: jobs, sweeps, experiments or others.

    Args:
        directories: the directories; a job in several of them counts once.
        own: True to import the user's own classes that configurations name.

    Raises:
        NoResults: if a directory doesn't exist, or no job can be read.
    """
    groups: dict[str, list[Part]] = {}
    left_out: list[str] = []
    found = repeated = 0
    so_far, places = RunsSoFar(), set[Path]()
    for directory in job_directories(directories):
        if directory.resolve() in places:
            continue
        places.add(directory.resolve())
        found += 1
        if not (directory / "summary.json").is_file():
            left_out.append(f"{directory}: hasn't finished")
            continue
        try:
            job = read_job(directory, own=own)
        except (OSError, ValueError) as error:
            left_out.append(str(error))
            continue
        runs = JobRuns.of(job.config)
        seeds = job.evaluations.seed
        if len(seeds) != job.config.num_seeds or (seeds != [*runs.seeds]).any():
            left_out.append(f"{directory}: evaluations.csv has other runs than the configuration")
            continue
        part = Part(job, so_far.add(runs))
        repeated += len(runs.seeds) - len(part.seeds)
        groups.setdefault(runs.configuration, []).append(part)
    where = ", ".join(map(str, directories))
    if not found:
        raise NoResults(f"{where}: has no jobs; a job has a file {_CONFIGURATION}")
    if not groups:
        raise NoResults(f"{where}: no job has results: {left_out[0]}")
    return Results([*map(Configuration, groups.values())], left_out, repeated)


def job_directories(directories: Iterable[Path]) -> Iterator[Path]:
    """Yield the directories of jobs, finished or not, in and below some directories.

    Raises:
        NoResults: if one of the directories doesn't exist.
    """
    for directory in directories:
        if not directory.is_dir():
            raise NoResults(f"{directory}: there is no such directory")
        for place, below, _ in os.walk(directory):
            if Path(place, _CONFIGURATION).is_file():
                below.clear()
                yield Path(place)
            # In this order the jobs of a sweep are those of its numbers.
            below[:] = sorted((name for name in below if name[0] != "."), key=_number_or_name)


def _number_or_name(name: str) -> tuple[Any, ...]:
    return (0, int(name), "") if name.isdecimal() else (1, 0, name)
