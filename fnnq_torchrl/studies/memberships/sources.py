"""The scores that labels from each source reach, each with its best step size."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.config.values import CLUSTERED
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.studies.reproduction.pool import same_seeds
from fnnq_torchrl.studies.statistics import choose_by_half
from fnnq_torchrl.training.weights import load_checkpoint

BY_HAND = "by hand"


@dataclass(frozen=True, eq=False)
class Source:
    """Labels of the bearing from one source.

    Attributes:
        name: the source.
        clustered: True if the labels were found by clustering.
        labels: [centre, σ] of each label at the start of learning.
        best_alpha: the best α by the first half of the seeds.
        scores: the mean scores of the second half at that α, ``[runs]``.
        runs: the number of seeds with each α.
        alphas: the tried α, in rising order.
        diverged: the number of diverged runs over all α.
    """

    name: str
    clustered: bool
    labels: list[list[float]]
    best_alpha: float
    scores: NDArray[np.float64]
    runs: int
    alphas: list[float]
    diverged: int

    @property
    def count(self) -> int:
        """The number of labels."""
        return len(self.labels)


def read_sources(experiment: Experiment) -> list[Source]:
    """Read the results of ``+experiment=memberships``, in the order of its jobs.

    Raises:
        NoResults: if the jobs have different seeds.
        OSError, ValueError: if a checkpoint can't be read, or there are too few seeds to halve.
    """
    runs, jobs = same_seeds(experiment.jobs), defaultdict[tuple[str, int], list[Job]](list)
    for job in experiment.jobs:
        jobs[name_of(job), len(labels_of(job))].append(job)
    return [_source(name, its_jobs, runs) for (name, _), its_jobs in jobs.items()]


def _source(name: str, jobs: list[Job], runs: int) -> Source:
    jobs = sorted(jobs, key=lambda job: float(job.config.alpha))
    best = choose_by_half([job.evaluations.mean_score[:runs] for job in jobs])
    alphas = [float(job.config.alpha) for job in jobs]
    return Source(
        name=name,
        clustered=jobs[0].config.value.membership == CLUSTERED,
        labels=labels_of(jobs[0]),
        best_alpha=alphas[best.choice],
        scores=best.judged,
        runs=runs,
        alphas=alphas,
        diverged=sum(job.evaluations.diverged_runs for job in jobs),
    )


def name_of(job: Job) -> str:
    """Return the name of the source of a job's labels."""
    value = job.config.value
    if value.membership == CLUSTERED:
        method = {"kmeans": "k-means", "mixture": "mixture of Gaussians"}[value.clustering]
        states = "random play" if value.visited is None else "learned runs"
        name = f"{method}, {states}"
    else:
        name = BY_HAND if value.membership == "paper" else "even"
    return f"{name}, then by gradient" if value.learn_memberships else name


def labels_of(job: Job) -> list[list[float]]:
    """Return [centre, σ] of a job's labels of the bearing at the start of learning.

    Raises:
        OSError, ValueError: if its checkpoint, which has the labels from clusters, can't be read.
    """
    value = job.config.value
    if value.membership != CLUSTERED:
        return [*value.inputs["bearing"]]
    checkpoint = load_checkpoint(job.directory / "checkpoint.pt")
    return [*checkpoint.config["value"]["inputs"]["bearing"]]
