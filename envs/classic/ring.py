"""The ring: small rewards in one direction, and a large one once a lap in the other."""

import torch
from torch import Tensor

from envs.classic.schemas import RingConfig
from envs.core.pure import Entries, PureEnv


class Ring(PureEnv):
    """The ring of Schweighofer and Doya's meta-learning, a world without end.

    States 0, 1, … form a ring. A step to the right (action 1) has the reward 1, and a step to the
    left (action 0) −1. Only the steps between the last state and state 0 differ: to the left,
    from 0 to the last, the reward is r₂, and to the right −r₂. The start is in the middle.

    A lap of n states to the left earns r₂ − (n − 1), a lap to the right the negative of that. So
    the best mean reward is |r₂ − (n − 1)|/n a step. After ``switch_after_steps`` steps, unless it
    is 0, r₂ is another one.

    Sources: N. Schweighofer, K. Doya, "Meta-learning in reinforcement learning", Neural Networks
    16, 2003; S. C. Tanaka et al., "Prediction of immediate and future rewards differentially
    recruits cortico-basal ganglia loops", Nature Neuroscience 7, 2004.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/ring.yaml``.
    """

    schema = RingConfig
    world: RingConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        return {"state": torch.full(seed.shape, self.world.states // 2).to(seed.device, self.dtype)}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        last = self.world.states - 1
        turn = 2 * action - 1
        moved = state["state"] + turn
        around = (moved < 0) | (moved > last)
        place = torch.where(moved < 0, last, torch.where(moved > last, 0, moved))
        return {
            "state": place.to(self.dtype),
            "reward": torch.where(around, -self._far_reward(state["step"]) * turn, turn),
            "terminated": torch.zeros_like(around),
        }

    def best_mean(self, step: Tensor) -> Tensor:
        states = self.world.states
        return (self._far_reward(step) - (states - 1)).abs() / states

    def _far_reward(self, step: Tensor) -> Tensor:
        """Return r₂ in a step of this number."""
        first = torch.full_like(step, 1, dtype=self.dtype) * self.world.far_reward
        if not self.world.switch_after_steps:
            return first
        return torch.where(step > self.world.switch_after_steps, self.world.switched_reward, first)
