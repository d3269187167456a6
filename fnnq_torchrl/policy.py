"""The TensorDict face of action selection."""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from fnnq_torchrl.exploration import epsilon_greedy
from fnnq_torchrl.layout import per_run, runs_first, runs_last
from fnnq_torchrl.values import ValueNetwork


class EpsilonGreedyPolicy(TensorDictModuleBase):
    """ε-greedy over candidate actions, each run with its own ε and its own random numbers.

    Reads the observations that the network names and ``chance``, a uniform random number of each
    run's own, which every state of a :class:`envs.pure.PureEnv` has. Writes ``action_value``
    ``[runs, candidates]`` and ``action`` ``[runs, 1]``. A policy like any other for
    ``env.rollout`` and TorchRL's collectors.

    Args:
        value_network: Q(s, a), and the candidates.
        epsilon: ε, one number or one per run, ``[runs, 1]``.
    """

    epsilon: Tensor

    def __init__(self, value_network: ValueNetwork, epsilon: Tensor | float) -> None:
        super().__init__()
        self.in_keys = [*value_network.in_keys, "chance"]
        self.out_keys = ["action_value", "action"]
        self.value_network = value_network
        dtype = value_network.candidates.dtype
        self.register_buffer("epsilon", torch.as_tensor(epsilon, dtype=dtype))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        values = self.value_network.values_in(tensordict)
        u = per_run(tensordict["chance"])
        chosen = epsilon_greedy(runs_last(values), per_run(self.epsilon).expand_as(u), u)
        tensordict["action_value"] = values
        tensordict["action"] = runs_first(self.value_network.candidates[chosen].unsqueeze(0))
        return tensordict
