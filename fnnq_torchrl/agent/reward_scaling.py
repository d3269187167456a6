"""The scaling of rewards of a batch of runs, as a TensorDict. Runs come first."""

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.equations.normalisation import Moments, RewardScale

SCALED = "scaled_reward"
"""The key of the scaled reward, which the loss then takes for the reward."""


class RewardScaling:
    """The running scale of the rewards that a batch of runs learns from.

    The state is a TensorDict ``[runs]`` with the ``trace`` of :class:`.RewardScale` and the entries
    of its :class:`.Moments`, each ``[runs, 1]``.
    """

    def start(self, run: TensorDictBase) -> TensorDict:
        """Return the state before the first step."""
        none = {key: torch.zeros_like(run["alpha"]) for key in ("trace", *Moments._fields)}
        return TensorDict(none, run.batch_size, device=run.device)

    def update(
        self, state: TensorDictBase, after: TensorDictBase, gamma: Tensor
    ) -> tuple[dict[str, Tensor], Tensor]:
        """Return the state after a step, and the step's scaled reward, ``[runs, 1]``.

        Args:
            state: the state before the step.
            after: the entry ``"next"`` of the step.
            gamma: γ in this step, ``[runs, 1]``.
        """
        before = RewardScale(state["trace"], Moments(*(state[key] for key in Moments._fields)))
        scale = before.with_reward(after["reward"], gamma, after["done"])
        return {"trace": scale.trace} | scale.moments._asdict(), scale.scaled(after["reward"])
