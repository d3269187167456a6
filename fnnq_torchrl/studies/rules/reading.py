"""What is to be read of a run: its rules, how strongly they fired, and the controller."""

from dataclasses import dataclass

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules import Controller
from fnnq_torchrl.studies.rules.job import Chosen, Job
from fnnq_torchrl.studies.rules.replay import Replay, distilled, greedy, replay
from fnnq_torchrl.training.firing import FIRING, read_firing

HARDLY = 1.0
"""A rule whose strengths add up to less in the replay is hardly trained."""


@dataclass(frozen=True, eq=False)
class Reading:
    """A run, ready to be told.

    Attributes:
        job: whose.
        chosen: which of its runs.
        played: the test, played by the full policy.
        fired: how strongly each rule fired in it, summed over its steps, as the consequents.
        learned: how strongly each rule fired while learning, summed over its steps, if the job has
            counted that; of the mean over runs, the mean.
        steps: how many steps there were.
        controller: what it does.
        full_score, distilled_score: the test's, of the full policy and of the distilled controller:
            its successes, or its mean return where it doesn't count successes.
    """

    job: Job
    chosen: Chosen
    played: Replay
    fired: Tensor
    learned: Tensor | None
    steps: int
    controller: Controller
    full_score: float
    distilled_score: float

    @property
    def hardly_trained(self) -> Tensor:
        """Which rules, bool, as the consequents."""
        return self.fired < HARDLY

    @property
    def score_words(self) -> str:
        """What the scores are."""
        best = self.job.config.best_score
        return "mean return" if best is None else f"successes in the test's {best} situations"


def read_run(job: Job, chosen: Chosen) -> Reading:
    """Play the test again, by the full policy and by the distilled controller."""
    rules, seeds = chosen.rules, torch.tensor([chosen.seed])
    full = replay(job, seeds, chosen.weights.unsqueeze(0), lambda each: greedy(job, each))
    states, actions = full.visited()
    fired = rules.firing(torch.cat([states, actions.unsqueeze(-1)], dim=-1)).sum(0)
    controller = rules.controller()
    numbers = controller.distilled.consequents.unsqueeze(0)
    other = replay(job, seeds, numbers, lambda each: distilled(job, controller.distilled, each))
    return Reading(
        job,
        chosen,
        full,
        fired,
        _learned(job, chosen),
        len(states),
        controller,
        _score(job, full),
        _score(job, other),
    )


def _learned(job: Job, chosen: Chosen) -> Tensor | None:
    path = job.directory / FIRING
    if not path.is_file():
        return None
    fired = read_firing(path, job.weights.shape)
    if chosen.spread is not None:
        return fired.mean(0)
    return fired[job.seeds.tolist().index(chosen.seed)]


def _score(job: Job, played: Replay) -> float:
    counted = job.config.best_score is not None
    return float(played.successes[0] if counted else played.returns[0])
