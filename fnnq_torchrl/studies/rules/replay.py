"""Replays of a job's test that record the observations and the action of each step.

A lane is one copy of the world; each run has a lane for each situation of the test.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.core.pure import PureEnv
from envs.worlds import make_world
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.rules import FuzzySystem
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.studies.rules.job import Job
from fnnq_torchrl.training.evaluation import FIRST_EPISODE

Choice = Callable[[TensorDictBase], TensorDictBase]
"""A policy: it sets the action in a state of the world, batch size ``[lanes]``."""

Weights = TypeVar("Weights", Tensor, TensorDict)
"""The weights of a network, or the consequents of a distilled controller."""


@dataclass(frozen=True, eq=False)
class Replay:
    """The replayed test of some runs, each situation from its start to its end.

    Attributes:
        env: the world that was played in.
        starts: the world's state before the first step, batch size ``[runs, situations]``.
        before: the observations before each step, and the action, batch size
            ``[steps, runs, situations]``.
        after: the world's state after each step, same batch size.
        counts: True for the steps before and at the situation's end, bool
            ``[steps, runs, situations]``.
        names: the state inputs of the rules, in the rules' order.
    """

    env: PureEnv
    starts: TensorDict
    before: TensorDict
    after: TensorDict
    counts: Tensor
    names: list[str]

    @property
    def successes(self) -> Tensor:
        """The number of situations that each run ended with a success, int64 ``[runs]``."""
        return (self.after["success"].squeeze(-1) & self.counts).any(0).sum(-1)

    @property
    def returns(self) -> Tensor:
        """Each run's mean return over its situations, ``[runs]``."""
        rewards = torch.where(self.counts, self.after["reward"].squeeze(-1), 0)
        return rewards.sum(0).mean(-1)

    def visited(self, run: int | None = None) -> tuple[Tensor, Tensor]:
        """Return the states and the actions of all steps that count.

        Args:
            run: the index of a run; all runs, if not given.

        Returns:
            The states ``[steps, state inputs]`` and the actions ``[steps]``, float64.
        """
        runs = slice(None) if run is None else slice(run, run + 1)
        before, counts = self.before[:, runs], self.counts[:, runs]
        states = torch.cat([before[name] for name in self.names], dim=-1)[counts]
        return states.double(), before["action"].squeeze(-1)[counts].double()


def greedy(job: Job, weights: TensorDict) -> Choice:
    """Return the greedy policy that the job's test uses.

    Args:
        job: the job, which has the network.
        weights: the weights of each lane by parameter name, batch size ``[lanes]``.
    """
    policy = EpsilonGreedyPolicy(job.network(), epsilon=0.0)
    never = torch.zeros(len(weights), 1, dtype=job.dtype)
    return lambda state: act(policy, weights, never, state)


def distilled(job: Job, system: FuzzySystem, numbers: Tensor) -> Choice:
    """Return the policy of distilled controllers, one for each lane.

    Args:
        job: the job.
        system: a distilled controller; the others have the same labels.
        numbers: each lane's consequents, float64 ``[lanes, labels of input 1, …]``.
    """
    names = [variable.name for variable in system.inputs]

    def choose(state: TensorDictBase) -> TensorDictBase:
        points = torch.cat([state[name] for name in names], dim=-1)
        action = (system.firing(points) * numbers).flatten(1).sum(-1, keepdim=True)
        return state.set("action", action.to(points.dtype))

    return choose


@torch.no_grad()
def replay(
    job: Job, seeds: Tensor, weights: Weights, choice: Callable[[Weights], Choice]
) -> Replay:
    """Replay the test of a job's last evaluation, with the same starts and random numbers.

    Args:
        job: the job.
        seeds: the seeds of the runs that play, int64 ``[runs]``.
        weights: the weights that each run plays with, ``[runs, …]`` or of batch size ``[runs]``.
        choice: a function from the lanes' weights ``[lanes, …]`` to their policy.
    """
    config: Config = job.config
    world = config.env.tested
    runs, tests = len(seeds), config.evaluation.tests
    lanes, like = runs * tests, job.candidates
    env = make_world(world, [lanes], seed=0, dtype=like.dtype)
    evaluation = config.situations // config.evaluation.every
    number = torch.arange(tests).repeat(runs)
    fixed = config.evaluation.fixed
    starts = None if fixed is None else torch.tensor(fixed, dtype=like.dtype)[number]
    episode = FIRST_EPISODE + evaluation * tests + number
    state = env.start(seeds.repeat_interleave(tests).unsqueeze(-1), episode.unsqueeze(-1), starts)
    first = state.clone()
    act_in = choice(weights[torch.arange(runs).repeat_interleave(tests)])
    goes_on = torch.ones(lanes, dtype=torch.bool)
    befores, afters, counts = [], [], []
    for _ in range(world.time_limit_steps):
        state = act_in(state)
        after = env.step(state)["next"]
        befores.append(state.select(*env.observation_spec.keys(), "action", strict=False))
        afters.append(after)
        counts.append(goes_on)
        goes_on = goes_on & ~after["done"].squeeze(-1)
        state = after.select(*state.keys(), strict=False)
        if not goes_on.any():
            break
    shape = (len(counts), runs, tests)
    return Replay(
        env,
        first.reshape(runs, tests),
        torch.stack(befores).reshape(shape),
        torch.stack(afters).reshape(shape),
        torch.stack(counts).reshape(shape),
        [*config.value.inputs],
    )
