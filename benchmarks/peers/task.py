"""The task of every learner: the same world, the same number of steps, and the same test."""

from collections.abc import Sequence
from copy import deepcopy
from time import perf_counter

import torch
from torch import Tensor, nn

from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.evaluation import FIRST_EPISODE

STEPS = 12_000
"""The number of learning steps: about as many as 200 situations take with λ = 0.2."""

EVERY = 400
"""The number of steps from one evaluation to the next."""


def moments(steps: int) -> list[int]:
    """Return the numbers of steps after which a learner is evaluated, from 0 on."""
    return list(range(0, steps + 1, EVERY))


def task() -> Config:
    """Return the default configuration: its world, candidates, γ and test are the peers' too."""
    return load_config()


class Diary:
    """Snapshots of a learning network, each with its steps and seconds of learning."""

    def __init__(self) -> None:
        self.steps: list[int] = []
        self.seconds: list[float] = []
        self.networks: list[nn.Module] = []
        self._start = perf_counter()

    def note(self, step: int, network: nn.Module) -> None:
        """Keep a copy of the network after a number of steps."""
        self.seconds.append(perf_counter() - self._start)
        self.steps.append(step)
        self.networks.append(deepcopy(network))


class WorldClock:
    """A clock of the seconds that a world spends in its own steps."""

    def __init__(self, world: FollowBall) -> None:
        self.seconds = 0.0
        self._step = world._step
        world._step = self._timed_step

    def _timed_step(self, tensordict):
        start = perf_counter()
        after = self._step(tensordict)
        self.seconds += perf_counter() - start
        return after


@torch.no_grad()
def score(networks: Sequence[nn.Module], seed: int, config: Config) -> list[int]:
    """Return the number of the test's situations that each network's greedy policy ends in a catch.

    Played side by side, all networks and situations, with the random numbers of
    `fnnq_torchrl.training.evaluation`.

    Args:
        networks: of the evaluations in turn; each takes bearings ``[n, 1]`` to the values of the
            candidates, ``[n, candidates]``.
        seed: the run's.
        config: has the world, the test and the number of candidates.
    """
    tests = torch.tensor(config.evaluation.situations)
    candidates = make_candidates(config)
    lanes = len(networks) * len(tests)
    env = FollowBall(config.env, [lanes])
    episode = FIRST_EPISODE + torch.arange(lanes).unsqueeze(-1)
    state = env.start(torch.full_like(episode, seed), episode, tests.repeat(len(networks), 1))
    caught = torch.zeros(lanes, 1, dtype=torch.bool)
    for _ in range(config.env.time_limit_steps):
        best = _greedy(networks, state["bearing"].view(len(networks), len(tests), 1))
        state = env.step(state.set("action", candidates[best].view(lanes, 1)))["next"]
        caught |= state["reward"] > 0  # before the time limit nothing else ends a situation
    return caught.view(len(networks), len(tests)).sum(1).tolist()


def _greedy(networks: Sequence[nn.Module], bearing: Tensor) -> Tensor:
    values = [network(seen) for network, seen in zip(networks, bearing, strict=True)]
    return torch.stack(values).argmax(-1)
