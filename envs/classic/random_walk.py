"""The random walk: chance moves the walker left or right, and the learner predicts the values."""

import torch
from torch import Tensor

from envs.classic.schemas import RandomWalkConfig
from envs.core import streams
from envs.core.pure import Entries, PureEnv
from envs.core.streams import Stream


class RandomWalk(PureEnv):
    """The random walk: R. S. Sutton, A. G. Barto, "Reinforcement learning", 2018, example 7.1.

    The walk starts in the middle of a row of states 1, 2, …. It ends with a reward to the left of
    the first state or to the right of the last state. All other rewards are 0. The only action, 0,
    has no effect.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/random_walk.yaml``.
    """

    schema = RandomWalkConfig
    world: RandomWalkConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        return {"place": torch.full(seed.shape, self.world.middle).to(seed.device, self.dtype)}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        world = self.world
        word, chance, *_ = streams.draw(state["seed"], state["episode"], state["step"], Stream.STEP)
        place = state["place"] + 2 * streams.coin(word).to(self.dtype) - 1
        left, right = place < 1, place > world.states
        reward = torch.zeros_like(place)
        reward = reward.masked_fill(left, world.left_reward).masked_fill(right, world.right_reward)
        return {
            "place": place,
            "chance": streams.uniform(chance, self.dtype),
            "reward": reward,
            "terminated": left | right,
            "success": right,
        }
