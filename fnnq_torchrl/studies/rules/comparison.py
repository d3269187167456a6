"""The test of a job's runs, played by their learned and by their distilled controllers."""

from dataclasses import dataclass

import torch

from fnnq_torchrl.agent.rules import Controller, RulesError
from fnnq_torchrl.studies.rules.job import Job
from fnnq_torchrl.studies.rules.replay import Replay, distilled, greedy, replay


@dataclass(frozen=True, eq=False)
class Comparison:
    """A job's test after learning, played twice by every run, from the same starts.

    Attributes:
        controllers: each run's best action and distilled controller.
        learned: the test as played by the best action.
        distilled: the test as played by the distilled controllers.
    """

    controllers: list[Controller]
    learned: Replay
    distilled: Replay


def compare(job: Job) -> Comparison:
    """Play a job's test after learning with the best action and with the distilled controllers.

    Raises:
        RulesError: if the job's runs have different labels.
    """
    if job.learns_labels:
        raise RulesError(f"{job.directory}: each run has learned its own labels")
    controllers = [job.rules(weights).controller() for weights in job.weights]
    system = controllers[0].distilled
    numbers = torch.stack([controller.distilled.consequents for controller in controllers])
    return Comparison(
        controllers,
        replay(job, job.seeds, job.weights, lambda each: greedy(job, each)),
        replay(job, job.seeds, numbers, lambda each: distilled(job, system, each)),
    )
