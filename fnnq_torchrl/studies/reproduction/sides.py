"""The sides of a comparison: a job, the change from one job to another, or the best of several."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.statistics import choose_by_half
from fnnq_torchrl.training.pictures.words import setting_words

from .claims import Settings
from .pool import words
from .quantities import Quantity


class Measured(NamedTuple):
    """A side in words, and one number for each run, ``[runs]``."""

    words: str
    runs: NDArray[np.float64]


@dataclass(frozen=True)
class Side(ABC):
    """A side of a comparison.

    Attributes:
        settings: the settings of its job or jobs.
    """

    settings: Settings

    @abstractmethod
    def measured(self, experiment: Experiment, where: Settings, quantity: Quantity) -> Measured:
        """Measure the side.

        Args:
            experiment: the experiment that has the side's jobs.
            where: settings of both sides.
            quantity: what is measured.

        Raises:
            NoResults: if a job is missing.
        """


class One(Side):
    """A job."""

    def measured(self, experiment: Experiment, where: Settings, quantity: Quantity) -> Measured:
        job = experiment.job_with({**where, **self.settings})
        return Measured(words(self.settings), quantity.of(job))


@dataclass(frozen=True)
class Change(Side):
    """The change from one job to another: the quantity of the second minus that of the first.

    Attributes:
        key: the key in which the two jobs differ.
        first, last: the key's values.
    """

    key: str
    first: Any
    last: Any

    def measured(self, experiment: Experiment, where: Settings, quantity: Quantity) -> Measured:
        first, last = (
            quantity.of(experiment.job_with({**where, **self.settings, self.key: value}))
            for value in (self.first, self.last)
        )
        ends = (setting_words(self.key, value) for value in (self.first, self.last))
        change = f"from {' to '.join(ends)}"
        return Measured(", ".join(filter(None, [words(self.settings), change])), last - first)


@dataclass(frozen=True)
class Best(Side):
    """The best of several jobs: the first half of the seeds chooses it, the second half judges it.

    Attributes:
        key: the key in which the jobs differ.
    """

    key: str

    def measured(self, experiment: Experiment, where: Settings, quantity: Quantity) -> Measured:
        own = {**where, **self.settings}
        jobs = [
            job
            for job in experiment.jobs
            if all(job.settings.get(key) == value for key, value in own.items())
        ]
        if not jobs:
            raise NoResults(f"{experiment.name} has no jobs with {words(own)}")
        chosen = choose_by_half(np.stack([quantity.of(job) for job in jobs]))
        best = setting_words(self.key, jobs[chosen.choice].settings[self.key])
        return Measured(f"{words(self.settings)} at its best, {best}", chosen.judged)
