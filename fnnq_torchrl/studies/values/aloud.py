"""The controllers that runs have learned on Mountain Car, as words."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.agent.rules import Controller
from fnnq_torchrl.studies.reproduction.markdown import table
from fnnq_torchrl.studies.rules.job import BEST, Chosen, Job, choose, read_job
from fnnq_torchrl.studies.rules.replay import distilled, greedy, replay

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Aloud:
    """The controllers of a job's runs, and how they play the job's last test.

    Attributes:
        job: the job.
        best: its best run.
        controllers: the controller of each run.
        full: each run's mean return by the greedy policy, ``[runs]``.
        short: each run's mean return by its controller alone, ``[runs]``.
    """

    job: Job
    best: Chosen
    controllers: list[Controller]
    full: Numbers
    short: Numbers

    @property
    def of_best(self) -> Controller:
        """The controller of the best run."""
        return self.best.rules.controller()

    def along(self, velocity: str) -> Numbers:
        """Return the number of each run's rules that push along the velocity, ``[runs]``.

        A rule pushes along it if its action and the middle of its label of the velocity lie on the
        same side of the middle of their ranges. Rules for a velocity of about 0 don't count.

        Args:
            velocity: the name of the velocity among the state inputs.
        """
        return np.array([self._of(each, velocity, _is_along) for each in self.controllers])

    def moving(self, velocity: str) -> int:
        """Return the number of rules for a velocity other than about 0."""
        return self._of(self.of_best, velocity, lambda push, velocity: velocity != 0)

    def _of(
        self, controller: Controller, velocity: str, counts: Callable[[float, float], bool]
    ) -> int:
        system = controller.distilled
        place = [each.name for each in system.inputs].index(velocity)
        low, high = controller.action.span()
        return sum(
            counts(action - (low + high) / 2, label.function.middle(label.parameters))
            for label, action in ((labels[place], action) for labels, action in system.rules())
        )

    def grid(self) -> str:
        """Return the best run's controller in Markdown: an action for each pair of labels.

        The rows are the labels of the first input, the columns those of the second.
        """
        system, controller = self.of_best.distilled, self.of_best
        first, second = system.inputs
        rows = [
            [label.name, *(f"{controller.word(x)} ({x:.2f})" for x in row)]
            for label, row in zip(first.labels, system.consequents.tolist(), strict=True)
        ]
        return table([f"{first.name} \\ {second.name}", *second.names], rows)


def _is_along(push: float, velocity: float) -> bool:
    return push * velocity > 0


def read_aloud(directory: Path) -> Aloud:
    """Read a finished job with rules, and replay its test with and without them distilled.

    Raises:
        OSError, ValueError: as in :func:`.read_job` and :func:`.choose`.
    """
    job = read_job(directory)
    controllers = [job.rules(weights).controller() for weights in job.weights]
    system = controllers[0].distilled
    numbers = torch.stack([each.distilled.consequents for each in controllers])
    full = replay(job, job.seeds, job.weights, lambda each: greedy(job, each))
    short = replay(job, job.seeds, numbers, lambda each: distilled(job, system, each))
    returns = (each.returns.double().numpy() for each in (full, short))
    return Aloud(job, choose(job, BEST), controllers, *returns)
