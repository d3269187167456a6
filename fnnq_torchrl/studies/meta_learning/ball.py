"""The schemes on the ball: a decaying α, a constant α, ObGD, and meta-learning."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.equations.names import ADAPTIVE_PARAMETERS
from fnnq_torchrl.studies.adaptive.scheme import Scheme, scheme_of
from fnnq_torchrl.studies.experiments import Experiment, Job, NoResults
from fnnq_torchrl.studies.reproduction.pool import same_seeds
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.results import FINAL_EVALUATIONS, Evaluations

_EVERYTHING = {"adaptive": "doya", "adaptive_parameters": [*ADAPTIVE_PARAMETERS]}
_ALPHA = {"adaptive": "doya", "adaptive_parameters": ["alpha"]}
_FIXED = {"adaptive": "none", "exploration": "epsilon_greedy", "trace": "output"}
_TRUE_ONLINE = {**_FIXED, "trace": "dutch"}

SCHEMES: dict[str, dict[str, Any]] = {
    "decaying α": {**_FIXED, "step_size": "decay"},
    "constant α": {**_FIXED, "step_size": "constant"},
    "ObGD": {**_FIXED, "step_size": "obgd"},
    "constant α, Boltzmann": {"adaptive": "none", "exploration": "boltzmann"},
    "meta-learned α, T, γ (steps)": {**_EVERYTHING, "adaptive_clock": "steps"},
    "meta-learned α, T, γ (situations)": {**_EVERYTHING, "adaptive_clock": "situations"},
    "meta-learned α (steps)": {**_ALPHA, "adaptive_clock": "steps"},
    "meta-learned α (situations)": {**_ALPHA, "adaptive_clock": "situations"},
    "IDBD": {**_FIXED, "step_size": "idbd"},
    "Autostep": {**_FIXED, "step_size": "autostep"},
    "TIDBD": {**_FIXED, "step_size": "tidbd"},
    "AutoTIDBD": {**_FIXED, "step_size": "auto_tidbd"},
    "true online Sarsa(λ)": {**_TRUE_ONLINE, "step_size": "constant"},
    "Swift-Sarsa": {**_TRUE_ONLINE, "step_size": "swift"},
}
"""The settings of each scheme by its words. One more scheme is one more line here."""

PAPERS = "decaying α"
"""The scheme that the others are compared with."""


def jobs_of(experiment: Experiment, name: str) -> list[Job]:
    """Return a scheme's jobs, one for each α, with α rising; none if the experiment lacks it."""
    settings = SCHEMES[name]
    jobs = [
        job
        for job in experiment.jobs
        if all(job.settings.get(key) == value for key, value in settings.items())
    ]
    return sorted(jobs, key=lambda job: job.settings["alpha"])


@dataclass(frozen=True, eq=False)
class Compared:
    """A scheme, and its scores minus those of the paper's decaying α.

    Attributes:
        scheme: the scores.
        at_best: the difference at each scheme's best α.
        over_alphas: the difference of the means over all α.
        jobs: the scheme's jobs, with α rising.
    """

    scheme: Scheme
    at_best: Interval
    over_alphas: Interval
    jobs: list[Job]


def compare(experiment: Experiment) -> dict[str, Compared]:
    """Return each scheme of an experiment, compared with the paper's.

    Raises:
        NoResults: if the paper's scheme is missing, or jobs have different seeds.
        ValueError: if there are too few runs for `choose_by_half`.
    """
    same_seeds(experiment.jobs)
    found = {name: jobs for name in SCHEMES if (jobs := jobs_of(experiment, name))}
    if PAPERS not in found:
        raise NoResults(f"{experiment.name} has no jobs with step_size=decay")
    schemes = {name: scheme_of(jobs) for name, jobs in found.items()}
    theirs = schemes[PAPERS]
    return {
        name: Compared(
            ours,
            paired_difference(ours.at_best, theirs.at_best).mean,
            paired_difference(ours.over_alphas, theirs.over_alphas).mean,
            found[name],
        )
        for name, ours in schemes.items()
    }


@dataclass(frozen=True, eq=False)
class Recovery:
    """A scheme's scores around a change of the world: means over all α, each ``[runs]``.

    Attributes:
        before: the mean of the last evaluations before the change.
        at_once: the evaluation at the change, with what was learned before it.
        after: the mean of all evaluations after the change.
        final: the mean of the last evaluations.
        diverged: the number of diverged runs of all jobs.
    """

    before: NDArray[np.float64]
    at_once: NDArray[np.float64]
    after: NDArray[np.float64]
    final: NDArray[np.float64]
    diverged: int

    @classmethod
    def of(cls, jobs: list[Job]) -> Self:
        runs = same_seeds(jobs)

        def over_alphas(part: slice, jobs: list[Job] = jobs) -> NDArray[np.float64]:
            scores = [job.evaluations.score[:runs, part].mean(axis=1) for job in jobs]
            mean: NDArray[np.float64] = np.mean(scores, axis=0)
            return mean

        change = change_of(jobs[0].evaluations, jobs[0].settings["env.change_at"])
        return cls(
            over_alphas(slice(max(1, change - FINAL_EVALUATIONS), change)),
            over_alphas(slice(change, change + 1)),
            over_alphas(slice(change + 1, None)),
            over_alphas(slice(-FINAL_EVALUATIONS, None)),
            sum(job.evaluations.diverged_runs for job in jobs),
        )


def change_of(evaluations: Evaluations, change_at: int) -> int:
    """Return the index of the first evaluation in the changed world."""
    return int(np.searchsorted(evaluations.situations, change_at))


def recoveries(experiment: Experiment, change: dict[str, Any]) -> dict[str, Recovery]:
    """Return each scheme's scores around a change.

    Args:
        experiment: the results of ``+experiment=changing_ball``.
        change: the settings of the change, such as ``{"env.swap_wheels": True}``.

    Raises:
        NoResults: if no job has this change, or jobs have different seeds.
    """
    for key, value in change.items():
        experiment = experiment.where(key, value)
    return {name: Recovery.of(jobs) for name in SCHEMES if (jobs := jobs_of(experiment, name))}


def mean(samples: NDArray[np.float64]) -> Interval:
    """Return the mean of the runs with its interval."""
    return bootstrap_interval(np.mean, samples)
