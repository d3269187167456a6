"""A job's test, played again: what the robot saw and did, step by step."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.worlds import make_world
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.rules import FuzzySystem
from fnnq_torchrl.studies.rules.job import Job
from fnnq_torchrl.training.evaluation import FIRST_EPISODE

Choice = Callable[[TensorDictBase], TensorDictBase]
"""Sets the action in a state of the world, ``[lanes]``."""


@dataclass(frozen=True, eq=False)
class Replay:
    """The test's situations of some runs, each from its start to its end.

    Attributes:
        before: the world before each step, batch size ``[steps, runs, situations]``, with the
            action.
        after: the world after it.
        counts: whether the situation hadn't ended before the step, bool ``[steps, runs,
            situations]``.
        names: the state inputs of the rules, in their order.
    """

    before: TensorDict
    after: TensorDict
    counts: Tensor
    names: list[str]

    @property
    def successes(self) -> Tensor:
        """How many situations each run ended in a success, int64 ``[runs]``."""
        return (self.after["success"].squeeze(-1) & self.counts).any(0).sum(-1)

    @property
    def returns(self) -> Tensor:
        """The mean return of each run's situations, ``[runs]``."""
        rewards = torch.where(self.counts, self.after["reward"].squeeze(-1), 0)
        return rewards.sum(0).mean(-1)

    def visited(self) -> tuple[Tensor, Tensor]:
        """The states and the actions of all steps that count, float64.

        Returns:
            ``[steps, states]`` and ``[steps]``.
        """
        states = torch.cat([self.before[name] for name in self.names], dim=-1)[self.counts]
        return states.double(), self.before["action"].squeeze(-1)[self.counts].double()


def greedy(job: Job, weights: Tensor) -> Choice:
    """The greedy policy of runs, as their test has it.

    Args:
        job: whose network.
        weights: of each lane, ``[lanes, labels of input 1, …, action labels]``.
    """
    policy = EpsilonGreedyPolicy(job.network(), epsilon=0.0)
    of_lanes = TensorDict({"weight": weights}, [len(weights)])
    never = torch.zeros(len(weights), 1, dtype=weights.dtype)
    return lambda state: act(policy, of_lanes, never, state)


def distilled(job: Job, system: FuzzySystem, numbers: Tensor) -> Choice:
    """Distilled controllers.

    Args:
        job: whose world.
        system: has the controllers' rules.
        numbers: of each lane, the rules' numbers, float64 ``[lanes, labels of input 1, …]``.
    """
    names = [variable.name for variable in system.inputs]

    def choose(state: TensorDictBase) -> TensorDictBase:
        points = torch.cat([state[name] for name in names], dim=-1)
        action = (system.firing(points) * numbers).flatten(1).sum(-1, keepdim=True)
        return state.set("action", action.to(points.dtype))

    return choose


@torch.no_grad()
def replay(job: Job, seeds: Tensor, weights: Tensor, choice: Callable[[Tensor], Choice]) -> Replay:
    """Play the test of a job's last evaluation again, from the same starts with the same chance.

    Args:
        job: whose test.
        seeds: of the runs that play, int64 ``[runs]``.
        weights: what each of them plays by, ``[runs, …]``.
        choice: makes the choice of lanes from their weights, ``[lanes, …]``.
    """
    config, world = job.config, job.config.env.tested
    runs, tests = len(seeds), config.evaluation.tests
    lanes, like = runs * tests, job.candidates
    env = make_world(world, [lanes], seed=0, dtype=like.dtype)
    evaluation = config.situations // config.evaluation.every
    number = torch.arange(tests).repeat(runs)
    fixed = config.evaluation.fixed
    starts = None if fixed is None else torch.tensor(fixed, dtype=like.dtype)[number]
    episode = FIRST_EPISODE + evaluation * tests + number
    state = env.start(seeds.repeat_interleave(tests).unsqueeze(-1), episode.unsqueeze(-1), starts)
    act_in = choice(weights.repeat_interleave(tests, dim=0))
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
        torch.stack(befores).reshape(shape),
        torch.stack(afters).reshape(shape),
        torch.stack(counts).reshape(shape),
        [*config.value.inputs],
    )
