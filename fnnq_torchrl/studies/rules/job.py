"""Finished jobs with ``value=fnnq``, and the choice of a run whose rules are read."""

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.rules import RuleBase, RulesError, partition
from fnnq_torchrl.agent.values import FNNQValue
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.results import best_first, read_evaluations
from fnnq_torchrl.training.weights import load_checkpoint

BEST, MEAN = "best", "mean"


@dataclass(frozen=True, eq=False)
class Job:
    """A finished job and the consequents that its runs have learned.

    Attributes:
        directory: the job's directory.
        config: the job's configuration.
        seeds: the seeds of the runs, int64 ``[runs]``.
        weights: the consequents of each run, ``[runs, labels of input 1, …, action labels]``.
    """

    directory: Path
    config: Config
    seeds: Tensor
    weights: Tensor

    @property
    def candidates(self) -> Tensor:
        """The actions that the greedy policy compares, ``[candidates]``."""
        return make_candidates(self.config, self.weights.dtype)

    def network(self) -> FNNQValue:
        """Return a network for a single run, with start weights."""
        return FNNQValue.from_config(self.config.value, self.candidates, 1)

    def rules(self, weights: Tensor) -> RuleBase:
        """Return the job's rule base with the given consequents.

        Args:
            weights: the consequents, ``[labels of input 1, …, action labels]``.
        """
        return RuleBase(
            partition(self.config.value, self.config.env),
            "value",
            weights.to(torch.float64),
            self.config.value.t_norm,
            self.config.value.elsewhere,
            tuple(self.candidates.to(torch.float64).tolist()),
        )


@dataclass(frozen=True, eq=False)
class Chosen:
    """A chosen run of a job, or the mean over the job's runs.

    Attributes:
        words: a description for titles, such as "seed 5".
        seed: the seed of the run, or of the first run if this is the mean.
        weights: the consequents, ``[labels of input 1, …, action labels]``.
        rules: the rule base with these consequents.
        spread: the standard deviation of each consequent over the runs; None for a single run.
    """

    words: str
    seed: int
    weights: Tensor
    rules: RuleBase
    spread: Tensor | None = None


def read_job(directory: Path, *, own: bool = False) -> Job:
    """Read a finished job with ``value=fnnq``.

    Args:
        directory: the job's directory.
        own: True to import the user's own classes that the job's configuration names.

    Raises:
        OSError: if checkpoint.pt can't be read.
        ValueError: if there is no finished job, its checkpoint.pt is damaged, its value function
            has no rules, or its runs learned their labels. The message is one line.
    """
    if not directory.is_dir():
        raise RulesError(f"{directory}: there is no such directory")
    if not (directory / "checkpoint.pt").is_file():
        raise RulesError(f"{directory}: has no checkpoint.pt, so it isn't a finished job")
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    config = to_config(checkpoint.config, own=own)
    if config.value.kind != "fnnq":
        raise RulesError(f"{directory}: value={config.value.kind} has no rules; value=fnnq has")
    if config.value.learn_memberships:
        advice = "read a single run with fnnq_torchrl.load_rules"
        raise RulesError(f"{directory}: each run has learned its own labels; {advice}")
    return Job(directory, config, checkpoint.seed, checkpoint.weights["weight"])


def choose(job: Job, which: str) -> Chosen:
    """Choose a run of a job, or the mean over its runs.

    Args:
        job: the job.
        which: ``best``, ``mean``, or a run's seed.

    Raises:
        OSError: if ``which`` is ``best`` and evaluations.csv, which has the scores, can't be read.
        ValueError: if evaluations.csv is damaged, or the job has no run with this seed. The message
            is one line.
    """
    seeds = job.seeds.tolist()
    if which == MEAN:
        mean, spread = job.weights.double().mean(0), job.weights.double().std(0, correction=0)
        words = f"the mean over {len(seeds):,} runs"
        return Chosen(words, seeds[0], mean.to(job.weights.dtype), job.rules(mean), spread)
    if which == BEST:
        place, score = _best(job)
        words = f"seed {seeds[place]}, the best of {len(seeds):,}: final score {score:.2f}"
    else:
        if not which.isdecimal() or int(which) not in seeds:
            span = f"{min(seeds)} to {max(seeds)}" if len(seeds) > 1 else str(seeds[0])
            raise RulesError(f"seed={which}: must be {BEST}, {MEAN} or one of {span}")
        place, words = seeds.index(int(which)), f"seed {which}"
    weights = job.weights[place]
    return Chosen(words, seeds[place], weights, job.rules(weights))


def _best(job: Job) -> tuple[int, float]:
    """Return the index and the final score of the run with the best final score.

    The mean score decides between runs with the same final score.
    """
    measure = job.config.env.tested.measure
    evaluations = read_evaluations(job.directory / "evaluations.csv", measure)
    if evaluations.seed.tolist() != job.seeds.tolist():
        raise RulesError(f"{job.directory}: evaluations.csv and checkpoint.pt have different runs")
    # A final score is a mean over a few evaluations, so many runs may have the same best score.
    sums = evaluations.final_score + 1e-6 * evaluations.mean_score
    place = best_first([sums[i : i + 1] for i in range(evaluations.runs)], measure)[0]
    return place, float(evaluations.final_score[place])
