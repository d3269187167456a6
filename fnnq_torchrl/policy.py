"""The TensorDict face of action selection."""

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from fnnq_torchrl.exploration import epsilon_greedy
from fnnq_torchrl.layout import over_batch, per_run, run_numbers
from fnnq_torchrl.values import ValueNetwork


class EpsilonGreedyPolicy(TensorDictModuleBase):
    """ε-greedy over candidate actions, each run with its own ε and its own random numbers.

    Reads the observations that the network names and ``chance``, a uniform random number of each
    run's own, which every state of a :class:`envs.pure.PureEnv` has. Writes ``action_value``
    ``[runs, *batch, candidates]`` and ``action`` ``[runs, *batch, 1]``. A policy like any other for
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
        candidates = value_network.candidates
        self.register_buffer("epsilon", run_numbers("epsilon", epsilon, like=candidates))

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        values = self.value_network.values_in(tensordict)
        u = per_run(tensordict["chance"])
        epsilon = over_batch(self.epsilon, like=u).expand_as(u)
        chosen = epsilon_greedy(values.movedim(-1, 0), epsilon, u)
        tensordict["action_value"] = values
        tensordict["action"] = self.value_network.candidates[chosen].unsqueeze(-1)
        return tensordict
