"""The chain: in each state one action leads on, and every other action sets back."""

from math import sqrt

import torch
from torch import Tensor

from envs.classic.schemas import ChainConfig
from envs.core.pure import Entries, PureEnv

_GOLDEN = (sqrt(5) - 1) / 2


class Chain(PureEnv):
    """A chain of states 1, 2, …, whose end is reached by the right action in every state.

    The right action leads to the next state. Any other action leads back by ``setback`` states, or
    to the first state if ``setback`` is null. The only reward is that of leaving the last state
    forwards, which ends the task. Nothing in the numbers of neighbouring states tells their right
    actions: those follow the golden ratio (:func:`right_action`).

    With ``setback: null`` it is the "reset state space" of S. Koenig, R. G. Simmons, "The effect
    of representation and knowledge on goal-directed exploration with reinforcement-learning
    algorithms", Machine Learning 22, 1996, also known as the combination lock; an unlearned walk
    needs some choicesⁿ steps to its end. With ``setback: 1`` and two actions that walk is a random
    walk and needs n(n + 1) steps on average.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/chain.yaml``.
    """

    schema = ChainConfig
    world: ChainConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        return {"place": torch.ones_like(seed, dtype=self.dtype)}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        world, place = self.world, state["place"]
        right = action == right_action(place, world.choices)
        back = torch.ones_like(place)
        if world.setback is not None:
            back = (place - world.setback).clamp(min=1)
        place = torch.where(right, place + 1, back)
        arrived = place > world.length
        return {
            "place": place,
            "reward": world.goal_reward * arrived.to(self.dtype),
            "terminated": arrived,
            "success": arrived,
        }


def right_action(place: Tensor, choices: int) -> Tensor:
    """Return the index of the right action in each state, ⌊choices · (0.618… · place mod 1)⌋.

    The multiples of the golden ratio, modulo 1, are evenly spread, so each action is right in about
    equally many states.

    Args:
        place: the states' numbers, real, any shape.
        choices: the number of actions.
    """
    share = place * _GOLDEN
    return (choices * (share - share.floor())).floor()
