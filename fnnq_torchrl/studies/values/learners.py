"""The learners of the study: each value function in each world, as chosen and as judged."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.studies.experiments import Experiment, Job, NoResults
from fnnq_torchrl.training.results import Evaluations

Numbers = NDArray[np.float64]

LAST = 3
"""The number of last tests over which the result after learning is the mean."""


@dataclass(frozen=True)
class World:
    """A world of the study.

    Attributes:
        kind: its kind in the configuration.
        title: its name for people.
        measure: the measure of a test, a noun in the plural.
        sign: 1 if a higher measure is better, else −1.
        digits: the number of decimals to which the measure is written.
    """

    kind: str
    title: str
    measure: str
    sign: int
    digits: int = 0

    def measured(self, evaluations: Evaluations) -> Numbers:
        """Return the measure of each run at each evaluation, ``[runs, evaluations]``.

        It is the number of catches on the ball, and the length of an episode elsewhere. A run that
        has diverged gets the worst measure.
        """
        if self.kind == "follow_ball":
            return evaluations.catches.astype(np.float64)
        if self.sign > 0:
            return np.where(evaluations.diverged, 0.0, evaluations.lengths)
        return evaluations.lengths


WORLDS = (
    World("mountain_car", "Mountain Car", "steps to the goal", -1),
    World("cart_pole", "Cart-Pole", "steps of balance", 1),
    World("acrobot", "Acrobot", "steps to the bar", -1),
)
"""The classic worlds of the study."""

BALL = World("follow_ball", "The ball", "catches of 5", 1, digits=2)

FUZZY, CHOICES = "fnnq", "fuzzy_q"


@dataclass(frozen=True, eq=False)
class Learner:
    """A value function in a world.

    Attributes:
        world: the world.
        value: the kind of the value function.
        judged: the job that judges it, on other seeds than those of the sweep.
        sweep: the jobs of the sweep, one for each λ and α.
    """

    world: World
    value: str
    judged: Job
    sweep: Sequence[Job]

    @property
    def curve(self) -> Numbers:
        """The measure of each run at each evaluation, ``[runs, evaluations]``."""
        return self.world.measured(self.judged.evaluations)

    @property
    def before(self) -> Numbers:
        """Each run's measure before learning, ``[runs]``."""
        return self.curve[:, 0]

    @property
    def meanwhile(self) -> Numbers:
        """Each run's mean measure over all tests after learning began, ``[runs]``."""
        return self.curve[:, 1:].mean(axis=1)

    @property
    def afterwards(self) -> Numbers:
        """Each run's mean measure over its last tests, ``[runs]``."""
        return self.curve[:, -LAST:].mean(axis=1)

    @property
    def failed(self) -> float:
        """The share of runs that are no better after learning than the mean before it."""
        return float((self.world.sign * (self.afterwards - self.before.mean()) <= 0).mean())

    @property
    def weights(self) -> int:
        """The number of weights of a run."""
        config = self.judged.config
        network = make_value_network(config.value, make_candidates(config), runs=1)
        return sum(weight.numel() for weight in network.parameters())

    @property
    def best(self) -> Job:
        """The job of the sweep with the best mean measure."""
        return max(self.sweep, key=self.swept)

    @property
    def is_best(self) -> bool:
        """True if the judged λ and α are the sweep's best."""
        return settings_of(self.judged) == settings_of(self.best)

    def swept(self, job: Job) -> float:
        """Return the mean measure of a job of the sweep, with the sign that makes more better.

        It is over the tests after learning began. Without tests, it is over the episodes learned
        from.
        """
        mean = self.world.measured(job.evaluations)[:, 1:].mean()
        return float(self.world.sign * mean)


def settings_of(job: Job) -> tuple[float, float]:
    """Return λ and α of a job."""
    return job.settings["lam"], job.settings["alpha"]


def read_learners(sweep: Experiment, judged: Experiment) -> list[Learner]:
    """Return the learners of all worlds, in the order of the judged jobs.

    Args:
        sweep: the results of ``+experiment=values_sweep``.
        judged: the results of ``+experiment=values``.

    Raises:
        NoResults: if a job is of another world, or the sweep has no jobs of a judged learner.
    """
    worlds = {world.kind: world for world in (*WORLDS, BALL)}
    learners = []
    for job in judged.jobs:
        kind, value = job.settings["env.kind"], job.settings["value.kind"]
        if kind not in worlds:
            raise NoResults(f"{job.directory}: isn't a job of experiment=values")
        of_world = sweep.where("env.kind", kind)
        of_learner = Experiment(f"{sweep.name} in {kind}", of_world.jobs).where("value.kind", value)
        learners.append(Learner(worlds[kind], value, job, of_learner.jobs))
    return learners


def in_world(learners: Sequence[Learner], world: World) -> list[Learner]:
    """Return the learners of a world, the best after learning first."""
    found = [each for each in learners if each.world is world]
    return sorted(found, key=lambda each: -world.sign * each.afterwards.mean())


def find(learners: Sequence[Learner], world: World, value: str) -> Learner:
    """Return the only learner with this value function in a world.

    Raises:
        NoResults: if there isn't exactly one.
    """
    found = [each for each in learners if each.world is world and each.value == value]
    if len(found) != 1:
        raise NoResults(f"values has {len(found)} jobs of value={value} in {world.kind}, not one")
    return found[0]
