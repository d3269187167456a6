"""The replayed test of a run: firing strengths, controller and scores."""

from dataclasses import dataclass

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules import Controller
from fnnq_torchrl.studies.rules.job import Chosen, Job
from fnnq_torchrl.studies.rules.replay import Replay, distilled, greedy, replay
from fnnq_torchrl.training.firing import FIRING, read_firing

HARDLY = 1.0
"""A rule counts as hardly trained if its firing strengths add up to less.

They are those of learning, if the job has counted them, or else those of the replay.
"""


@dataclass(frozen=True, eq=False)
class Reading:
    """A run's rules with the results of replaying its test.

    Attributes:
        job: the job.
        chosen: the run of the job, or the mean over its runs.
        played: the test as played by the full (greedy) policy.
        fired: each rule's firing strength, summed over the steps of ``played``; for each part of
            the rules, shaped like its consequents.
        learned: each rule's firing strength, summed over the steps of learning, or its mean over
            the runs; None if the job has no such file.
        steps: the number of steps in ``played``.
        controller: the rules' best action over the states, with its distilled controller.
        full_score: the score of the full policy in the test: the number of successes, or the mean
            return if the test doesn't count successes.
        distilled_score: the same score of the distilled controller.
    """

    job: Job
    chosen: Chosen
    played: Replay
    fired: tuple[Tensor, ...]
    learned: Tensor | None
    steps: int
    controller: Controller
    full_score: float
    distilled_score: float

    @property
    def score_words(self) -> str:
        """The name of the scores' measure, for people."""
        best = self.job.config.best_score
        return "mean return" if best is None else f"successes in the test's {best} situations"


def read_run(job: Job, chosen: Chosen) -> Reading:
    """Replay the test with the full policy and with the distilled controller.

    Raises:
        OSError, ValueError: if the file of the firing strengths can't be read or is damaged.
    """
    rules, seeds = chosen.rules, torch.tensor([chosen.seed])
    full = replay(job, seeds, chosen.weights.unsqueeze(0), lambda each: greedy(job, each))
    states, actions = full.visited()
    points = torch.cat([states, actions.unsqueeze(-1)], dim=-1)
    columns = [*full.names, rules.action.name]
    fired = tuple(
        part.firing(points[:, [columns.index(each.name) for each in part.inputs]]).sum(0)
        for part in chosen.parts
    )
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
    fired = read_firing(path, job.weights["weight"].shape)
    if chosen.spread:
        return fired.mean(0)
    return fired[job.seeds.tolist().index(chosen.seed)]


def _score(job: Job, played: Replay) -> float:
    counted = job.config.best_score is not None
    return float(played.successes[0] if counted else played.returns[0])
