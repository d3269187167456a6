"""The arms of the study: jobs with different prior knowledge, and their results."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from fnnq_torchrl.agent.rules import RuleBase, partition
from fnnq_torchrl.studies.experiments import Experiment, Job, NoResults
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.training.start import read_start
from fnnq_torchrl.training.weights import load_checkpoint

NOTHING, HOPES, ROUGH, WRONG, OPERATOR = (
    "nothing",
    "high hopes",
    "rough controller",
    "wrong controller",
    "noisy operator",
)

_SOURCES = {
    (None, None): NOTHING,
    ("hopeful.txt", None): HOPES,
    ("rough.txt", None): ROUGH,
    ("wrong.txt", None): WRONG,
    (None, "operator.csv"): OPERATOR,
}
"""The name of an arm's prior knowledge, by ``rules.prior`` and ``rules.demonstrations``."""

_BEARINGS = 181


@dataclass(frozen=True, eq=False)
class Arm:
    """A job of the experiment.

    Attributes:
        source: the name of the prior knowledge, such as :data:`ROUGH`.
        margin: ``rules.margin``, in units of Q.
        job: the job's results.
        start: the consequents before learning, float64 ``[bearing labels, steer labels]``.
        learned: the consequents after learning, ``[runs, bearing labels, steer labels]``.
        rules: a rule base with the job's labels; its consequents are 0.
    """

    source: str
    margin: float
    job: Job
    start: Tensor
    learned: Tensor
    rules: RuleBase

    @property
    def words(self) -> str:
        """The arm's name, with its margin if its prior knowledge has one."""
        return self.source if self.source in (NOTHING, HOPES) else f"{self.source}, {self.margin:g}"

    @property
    def curve(self) -> NDArray[np.float64]:
        """The mean score over the runs, ``[evaluations]``."""
        curve: NDArray[np.float64] = self.job.evaluations.score.mean(axis=0)
        return curve

    def measure(self, name: str) -> NDArray[np.float64]:
        """Return a measure of each run, ``[runs]``.

        Args:
            name: a key of :data:`.MEASURES`.
        """
        return MEASURES[name].of(self.job.evaluations)

    def distance_to(self, consequents: Tensor) -> NDArray[np.float64]:
        """Return the distance of each run's best action from that of other consequents, ``[runs]``.

        It is the mean absolute difference over the bearings at which a ball can start.

        Args:
            consequents: the other consequents, ``[bearing labels, steer labels]``.
        """
        start_angle = self.job.config.env.start_angle_rad
        bearings = torch.linspace(-start_angle, start_angle, _BEARINGS, dtype=torch.float64)
        candidates = torch.tensor(self.rules.candidates, dtype=torch.float64)
        firing = self.rules.firing(torch.cartesian_prod(bearings, candidates)).flatten(1)

        def best(weights: Tensor) -> Tensor:
            values = weights.double().flatten(1) @ firing.T
            return candidates[values.view(len(values), _BEARINGS, -1).argmax(-1)]

        other = best(consequents.unsqueeze(0))
        distances: NDArray[np.float64] = (best(self.learned) - other).abs().mean(-1).numpy()
        return distances


def read_arms(experiment: Experiment) -> list[Arm]:
    """Read the arms of ``+experiment=prior``, in the order of its jobs.

    Raises:
        NoResults: if a job doesn't belong to this experiment.
        OSError, ValueError: if a file can't be read, or is damaged.
    """
    return [_read_arm(job) for job in experiment.jobs]


def _read_arm(job: Job) -> Arm:
    told = (job.settings.get("rules.prior"), job.settings.get("rules.demonstrations"))
    if told not in _SOURCES:
        raise NoResults(f"{job.directory}: isn't a job of experiment=prior")
    variables = partition(job.config.value, job.config.env)
    zeros = torch.zeros([len(variable.labels) for variable in variables])
    rules = RuleBase(variables, "value", zeros)
    start = read_start(job.config)
    return Arm(
        _SOURCES[told],
        job.settings["rules.margin"],
        job,
        rules.consequents if start is None else start.consequents,
        load_checkpoint(job.directory / "checkpoint.pt").weights["weight"],
        rules,
    )


def find(arms: list[Arm], source: str, margin: float | None = None) -> Arm:
    """Return the first arm with this source and, if given, this margin.

    Raises:
        NoResults: if there is no such arm.
    """
    for arm in arms:
        if arm.source == source and margin in (None, arm.margin):
            return arm
    raise NoResults(f"prior has no jobs of {source}")
