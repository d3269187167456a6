"""The paper's test: how many of some fixed situations does the greedy policy end in a catch?"""

from collections.abc import Callable

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.robot.follow import FollowBall
from envs.robot.schemas import World
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.engine.choice import Engine
from fnnq_torchrl.engine.loops import Step

FIRST_EPISODE = 2**32
"""Evaluations draw their random numbers as episodes from here on, which learning never reaches."""


class Playing:
    """The :class:`.Task` of playing fixed situations greedily, without learning.

    Each situation of each snapshot of weights is a job. Random numbers are the run's own, new ones
    for every evaluation.

    Args:
        value_network: whose weights the snapshots replace.
        world: in which to play.
        situations: starts of the ball (φ₀, ω_b), in rad and rad/s, ``[situations, 2]``.
        seed: the runs' seeds, int64 ``[runs, 1]``.
        weights: the snapshots, by the network's names, batch size ``[evaluations, runs]``.
        played: which situations each has played so far, bool ``[evaluations, runs, situations]``;
            kept up to date.
        catches: how many of them it has caught, int64 ``[evaluations, runs]``; kept up to date.
        engine: makes the loop, for ``lanes``.
        lanes: how many situations are played side by side.
        on_progress: is told how many situations, of all snapshots together, are played.
    """

    def __init__(
        self,
        value_network: ValueNetwork,
        world: World,
        situations: Tensor,
        seed: Tensor,
        weights: TensorDictBase,
        played: Tensor,
        catches: Tensor,
        engine: Engine,
        lanes: int,
        on_progress: Callable[[int], None],
    ) -> None:
        evaluations, self._runs = catches.shape
        self._policy = EpsilonGreedyPolicy(value_network, epsilon=0.0)
        self._world, self._situations = world, situations
        self._env = self._make_env(lanes)
        self._weights = weights.view(evaluations * self._runs)
        self._seed = seed
        self._played, self._catches = played.view(-1), catches.view(-1)
        self._done, self._on_progress = int(played.sum()), on_progress
        self.steps = world.time_limit_steps
        example = self.begin(torch.zeros(lanes, dtype=torch.int64))
        self.loop = engine.make_loop(self._make_step, *example)

    @property
    def jobs(self) -> Tensor:
        """The situations of snapshots that aren't played, int64."""
        return (~self._played).nonzero().squeeze(-1)

    def begin(self, jobs: Tensor) -> tuple[TensorDict, TensorDict]:
        jobs = jobs.to(self._seed.device)
        snapshot, situation = jobs // len(self._situations), jobs % len(self._situations)
        evaluation, run = snapshot // self._runs, snapshot % self._runs
        number = evaluation * len(self._situations) + situation
        world = self._env.start(
            self._seed[run], FIRST_EPISODE + number.unsqueeze(-1), self._situations[situation]
        )
        batch = {"batch_size": jobs.shape, "device": jobs.device}
        never = torch.zeros_like(world["bearing"])
        stays = TensorDict({"weights": self._weights[snapshot], "epsilon": never}, **batch)
        no = torch.zeros_like(never, dtype=torch.bool)
        return stays, TensorDict({"world": world, "over": no, "caught": no.clone()}, **batch)

    def _make_env(self, lanes: int) -> FollowBall:
        like = self._situations
        return FollowBall(self._world, [lanes], dtype=like.dtype, device=like.device)

    def _make_step(self, lanes: int) -> Step:
        env = self._make_env(lanes)

        def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
            world = act(self._policy, stays["weights"], stays["epsilon"], state["world"])
            after = env.step(world)["next"]
            caught = state["caught"] | ((after["reward"] > 0) & ~state["over"])
            over = state["over"] | after["terminated"]
            world = after.select(*state["world"].keys())
            return TensorDict(
                {"world": world, "over": over, "caught": caught},
                state.batch_size,
                device=state.device,
            )

        return step

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        over = state["over"].squeeze(-1).cpu()
        lanes = ((jobs >= 0) & over).nonzero().squeeze(-1)
        snapshot = jobs[lanes] // len(self._situations)
        caught = state["caught"].squeeze(-1).cpu()[lanes].long()
        self._catches.index_add_(0, snapshot, caught)
        self._played[jobs[lanes]] = True
        self._done += len(lanes)
        self._on_progress(self._done)
        return over
