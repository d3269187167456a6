"""Two states, whose values learn or diverge depending on how values are approximated."""

import torch
from torch import Tensor

from envs.classic.schemas import TwoStatesConfig
from envs.core import streams
from envs.core.pure import Entries, PureEnv
from envs.core.streams import Stream


class TwoStates(PureEnv):
    """The two states of J. N. Tsitsiklis and B. Van Roy, in which a value function is predicted.

    Each of the states 1 and 2 leads to state 2. An episode starts in either with the same
    probability. It never ends, but is truncated by the time limit, and its last target bootstraps.
    With a limit of one step, both states are updated equally often, as in the original; the longer
    the episodes, the nearer the updates are to the distribution of the states. The reward is
    ±``noise`` by chance, so all values are 0. (In the original all rewards are 0 and the values
    start elsewhere.) The only action, 0, has no effect.

    Source: J. N. Tsitsiklis, B. Van Roy, "Feature-based methods for large scale dynamic
    programming", Machine Learning 22, 1996; R. S. Sutton, A. G. Barto, "Reinforcement learning",
    2018, example 11.1.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/two_states.yaml``.
    """

    schema = TwoStatesConfig
    world: TwoStatesConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        word, *_ = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        return {"place": 1 + streams.coin(word).to(self.dtype)}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        word, chance, *_ = streams.draw(state["seed"], state["episode"], state["step"], Stream.STEP)
        place = torch.full_like(state["place"], 2)
        never = torch.zeros_like(place, dtype=torch.bool)
        return {
            "place": place,
            "chance": streams.uniform(chance, self.dtype),
            "reward": self.world.noise * (2 * streams.coin(word).to(self.dtype) - 1),
            "terminated": never,
            "success": never,
        }
