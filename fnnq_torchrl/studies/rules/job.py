"""Finished jobs with rules, and the choice of a run whose rules are read."""

from dataclasses import dataclass
from pathlib import Path

import torch
from tensordict import TensorDict
from torch import Tensor

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.rules import RuleBase, RulesError, rule_bases
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.results import best_run, read_evaluations
from fnnq_torchrl.training.weights import load_checkpoint

BEST, MEAN = "best", "mean"

KINDS = ("fnnq", "fnnq_sum", "fuzzy_q")
"""The value functions with rules."""


@dataclass(frozen=True, eq=False)
class Job:
    """A finished job and the weights that its runs have learned.

    Attributes:
        directory: the job's directory.
        config: the job's configuration.
        seeds: the seeds of the runs, int64 ``[runs]``.
        weights: the weights of each run by parameter name, batch size ``[runs]``.
    """

    directory: Path
    config: Config
    seeds: Tensor
    weights: TensorDict

    @property
    def dtype(self) -> torch.dtype:
        """The precision of the weights."""
        return next(iter(self.weights.values())).dtype

    @property
    def candidates(self) -> Tensor:
        """The actions that the greedy policy compares, ``[candidates]``."""
        return make_candidates(self.config, self.dtype)

    @property
    def learns_labels(self) -> bool:
        """True if each run has learned its own labels."""
        return bool(getattr(self.config.value, "learn_memberships", False))

    @property
    def names(self) -> list[str]:
        """The name of each part's consequents among the weights."""
        return [name for name, _ in self.network().named_parameters() if name.endswith("weight")]

    def network(self) -> ValueNetwork:
        """Return a network for a single run, with start weights."""
        return make_value_network(self.config.value, self.candidates, 1)

    def parts(self, weights: TensorDict) -> tuple[RuleBase, ...]:
        """Return the rule bases with the given weights; their values add up.

        Args:
            weights: the weights of a run, batch size ``[]``.
        """
        network = self.network()
        network.load_state_dict(network.state_dict() | weights.unsqueeze(0).to_dict())
        return rule_bases(network, self.config.value, self.config.env, run=0)

    def rules(self, weights: TensorDict) -> RuleBase:
        """Return the single rule base with the given weights, as in :meth:`parts`."""
        return RuleBase.from_sum(self.parts(weights), [*self.config.value.inputs])


@dataclass(frozen=True, eq=False)
class Chosen:
    """A chosen run of a job, or the mean over the job's runs.

    Attributes:
        words: a description for titles, such as "seed 5".
        seed: the seed of the run, or of the first run if this is the mean.
        weights: the weights by parameter name, batch size ``[]``.
        parts: the rule bases with these weights; their values add up.
        rules: the single rule base with the same values.
        spread: the standard deviation over the runs of each part's consequents; empty for a single
            run.
    """

    words: str
    seed: int
    weights: TensorDict
    parts: tuple[RuleBase, ...]
    rules: RuleBase
    spread: tuple[Tensor, ...] = ()


def read_job(directory: Path, *, own: bool = False) -> Job:
    """Read a finished job with rules.

    Args:
        directory: the job's directory.
        own: True to import the user's own classes that the job's configuration names.

    Raises:
        OSError: if checkpoint.pt can't be read.
        ValueError: if there is no finished job, its checkpoint.pt is damaged, or its value
            function has no rules. The message is one line.
    """
    if not directory.is_dir():
        raise RulesError(f"{directory}: there is no such directory")
    if not (directory / "checkpoint.pt").is_file():
        raise RulesError(f"{directory}: has no checkpoint.pt, so it isn't a finished job")
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    config = to_config(checkpoint.config, own=own)
    if config.value.kind not in KINDS:
        words = f"value={config.value.kind} has no rules; {', '.join(KINDS)} have"
        raise RulesError(f"{directory}: {words}")
    weights = TensorDict(checkpoint.weights, [len(checkpoint.seed)])
    return Job(directory, config, checkpoint.seed, weights)


def choose(job: Job, which: str) -> Chosen:
    """Choose a run of a job, or the mean over its runs.

    Args:
        job: the job.
        which: ``best``, ``mean``, or a run's seed.

    Raises:
        OSError: if ``which`` is ``best`` and evaluations.csv, which has the scores, can't be read.
        ValueError: if evaluations.csv is damaged, the job has no run with this seed, there is no
            mean because each run has learned its own labels, or as in :meth:`.RuleBase.from_sum`.
            The message is one line.
    """
    seeds = job.seeds.tolist()
    if which == MEAN:
        if job.learns_labels:
            raise RulesError(f"seed={MEAN}: each run has learned its own labels; name one run")
        exact = job.weights.double()
        weights = exact.mean(0)
        spread = tuple(exact[name].std(0, correction=0) for name in job.names)
        words = f"the mean over {len(seeds):,} runs"
        parts, rules = job.parts(weights), job.rules(weights)
        return Chosen(words, seeds[0], weights.to(job.dtype), parts, rules, spread)
    if which == BEST:
        place, score = _best(job)
        words = f"seed {seeds[place]}, the best of {len(seeds):,}: final score {score:.2f}"
    else:
        if not which.isdecimal() or int(which) not in seeds:
            span = f"{min(seeds)} to {max(seeds)}" if len(seeds) > 1 else str(seeds[0])
            raise RulesError(f"seed={which}: must be {BEST}, {MEAN} or one of {span}")
        place, words = seeds.index(int(which)), f"seed {which}"
    weights = job.weights[place]
    return Chosen(words, seeds[place], weights, job.parts(weights), job.rules(weights))


def _best(job: Job) -> tuple[int, float]:
    """Return the index and the final score of the run with the best final score."""
    measure = job.config.env.tested.measure
    evaluations = read_evaluations(job.directory / "evaluations.csv", measure)
    if evaluations.seed.tolist() != job.seeds.tolist():
        raise RulesError(f"{job.directory}: evaluations.csv and checkpoint.pt have different runs")
    place = best_run(evaluations)
    return place, float(evaluations.final_score[place])
