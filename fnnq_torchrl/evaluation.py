"""The paper's test: how many of some fixed situations does the greedy policy end in a catch?"""

from collections.abc import Callable

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.follow_ball import FollowBall
from envs.world import World
from fnnq_torchrl.lanes import pad
from fnnq_torchrl.layout import runs_first, runs_last
from fnnq_torchrl.policy import EpsilonGreedyPolicy
from fnnq_torchrl.program import act

FIRST_EPISODE = 2**32
"""Evaluations draw their random numbers as episodes from here on, which learning never reaches."""

_LANES = 2**14
"""Situations played side by side: enough to keep the machine busy, few enough to stay in cache."""


class Evaluation:
    """Plays fixed situations greedily, without learning, for any number of snapshots of weights.

    Each situation of each snapshot is a lane of one batch. Random numbers are the run's own, new
    ones for every evaluation.

    Args:
        policy: chooses the actions; its network's weights are replaced by the snapshots'.
        world: the learning world's parameters: same time limit, same sensor.
        situations: starts of the ball (φ₀, ω_b), in rad and rad/s, ``[situations, 2]``.
    """

    def __init__(self, policy: EpsilonGreedyPolicy, world: World, situations: Tensor) -> None:
        self.policy = policy
        self.world = world
        self.situations = situations

    def score(
        self,
        snapshots: TensorDictBase,
        on_progress: Callable[[int], None] = lambda done: None,
    ) -> Tensor:
        """How many of the situations each snapshot ends in a catch.

        Args:
            snapshots: ``weights`` by name, ``seed`` and ``evaluation`` (its number, for the random
                numbers) of shape ``[snapshots, 1]``; batch size ``[snapshots]``.
            on_progress: is told the number of situations played so far.

        Returns:
            int64 ``[snapshots]``, from 0 to the number of situations.
        """
        slice_size = max(1, _LANES // len(self.situations))
        scores = []
        for part in snapshots.split(slice_size):
            scores.append(self._score_slice(part))
            on_progress(sum(map(len, scores)) * len(self.situations))
        return torch.cat(scores)

    def _score_slice(self, snapshots: TensorDictBase) -> Tensor:
        count = len(self.situations)
        lanes = len(snapshots) * count
        snapshot = pad(torch.arange(lanes, device=self.situations.device)) // count
        situation = pad(torch.arange(lanes, device=self.situations.device)) % count
        weights = {
            name: runs_first(runs_last(weight).index_select(-1, snapshot))
            for name, weight in snapshots["weights"].items()
        }
        number = snapshots["evaluation"][snapshot] * count + situation.unsqueeze(-1)
        env = FollowBall(
            self.world,
            [len(snapshot)],
            situations=self.situations[situation],
            dtype=self.situations.dtype,
            device=self.situations.device,
        )
        world = env.start(snapshots["seed"][snapshot], FIRST_EPISODE + number)
        caught = self._play(env, world, weights)
        return caught[:lanes].view(-1, count).sum(-1)

    def _play(self, env: FollowBall, world: TensorDict, weights: dict[str, Tensor]) -> Tensor:
        """Which lanes end in a catch: bool ``[lanes]``."""
        greedy = torch.zeros_like(world["bearing"])
        over = torch.zeros_like(greedy, dtype=torch.bool)
        caught = over
        for _ in range(self.world.time_limit_steps):
            world = env.step(act(self.policy, weights, greedy, world))["next"]
            caught = caught | ((world["reward"] > 0) & ~over)
            over = over | world["terminated"]
            if over.all():
                break
        return caught.squeeze(-1)
