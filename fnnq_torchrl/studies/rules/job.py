"""The rules that a finished job has learned."""

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
    """A job's runs.

    Attributes:
        directory: where its files are.
        config: its configuration.
        seeds: the runs', int64 ``[runs]``.
        weights: the consequents of each run, ``[runs, labels of input 1, …, action labels]``.
    """

    directory: Path
    config: Config
    seeds: Tensor
    weights: Tensor

    @property
    def candidates(self) -> Tensor:
        """The actions among which the best is sought, ``[candidates]``."""
        return make_candidates(self.config, self.weights.dtype)

    def network(self) -> FNNQValue:
        """The network of a single run, whose weights are to be replaced."""
        return FNNQValue.from_config(self.config.value, self.candidates, 1)

    def rules(self, weights: Tensor) -> RuleBase:
        """The rules with some consequents, ``[labels of input 1, …, action labels]``."""
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
    """What is to be read of a job: one run, or the mean over them.

    Attributes:
        words: which it is, for people.
        seed: the run's; of the mean, the first run's.
        weights: the consequents.
        rules: the same as rules.
        spread: the standard deviation of each consequent over the runs; of the mean only.
    """

    words: str
    seed: int
    weights: Tensor
    rules: RuleBase
    spread: Tensor | None = None


def read_job(directory: Path, *, own: bool = False) -> Job:
    """Read a finished job of ``value=fnnq``.

    Args:
        directory: the job's.
        own: whether to import classes of the user's own that its configuration names.

    Raises:
        OSError: its checkpoint.pt can't be read.
        ValueError: it is damaged, or the job's value function has no rules. One line.
    """
    if not directory.is_dir():
        raise RulesError(f"{directory}: there is no such directory")
    if not (directory / "checkpoint.pt").is_file():
        raise RulesError(f"{directory}: has no checkpoint.pt, so it is no finished job")
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    config = to_config(checkpoint.config, own=own)
    if config.value.kind != "fnnq":
        raise RulesError(f"{directory}: value={config.value.kind} has no rules; value=fnnq has")
    if config.value.learn_memberships:
        advice = "fnnq_torchrl.load_rules reads one run's"
        raise RulesError(f"{directory}: each of its runs has labels of its own; {advice}")
    return Job(directory, config, checkpoint.seed, checkpoint.weights["weight"])


def choose(job: Job, which: str) -> Chosen:
    """Choose a run of a job, or the mean over its runs.

    Args:
        job: which.
        which: ``best``, ``mean``, or a run's seed.

    Raises:
        OSError: evaluations.csv, which says which run is the best, can't be read.
        ValueError: that is damaged, or there is no such run. One line.
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
    """The place and the final score of the best run, by the final and then by the mean score."""
    measure = job.config.env.tested.measure
    evaluations = read_evaluations(job.directory / "evaluations.csv", measure)
    if evaluations.seed.tolist() != job.seeds.tolist():
        raise RulesError(f"{job.directory}: evaluations.csv and checkpoint.pt have other runs")
    # A final score is a mean over a few evaluations, so that many runs may share the best one.
    sums = evaluations.final_score + 1e-6 * evaluations.mean_score
    place = best_first([sums[i : i + 1] for i in range(evaluations.runs)], measure)[0]
    return place, float(evaluations.final_score[place])
