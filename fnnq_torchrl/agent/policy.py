"""Exploring policies as TensorDict modules."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from envs.core.parameters import OutOfRange
from envs.core.registry import class_of, is_own, kinds_in_words
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.equations import exploration
from fnnq_torchrl.equations.layout import over_batch, per_run, run_numbers
from fnnq_torchrl.equations.names import EXPLORATIONS


class ExploringPolicy(TensorDictModuleBase, ABC):
    """The base class of policies that choose an action by Q(s, ·) and a random number of the run.

    The policy reads the network's observations and ``chance``, a uniform random number that every
    :class:`envs.core.pure.PureEnv` provides. It writes ``action_value``
    ``[runs, *batch, candidates]`` and ``action`` ``[runs, *batch, 1]``. It works with
    ``env.rollout`` and TorchRL's collectors. A network may let the policy choose in its own way
    (:meth:`.ValueNetwork.decide`): then each of its rules chooses by its own values.

    Args:
        value_network: Q(s, a) with the candidate actions.
        amount: the amount of exploration, one number or one per run, ``[runs, 1]``; it is stored in
            the buffer named ``amount_name``.
    """

    amount_name: str

    def __init__(self, value_network: ValueNetwork, amount: Tensor | float) -> None:
        super().__init__()
        self.in_keys = [*value_network.in_keys, *value_network.chance_keys]
        self.out_keys = [*dict.fromkeys(("action_value", value_network.choice_key, "action"))]
        self.value_network = value_network
        numbers = run_numbers(self.amount_name, amount, like=value_network.candidates)
        self.register_buffer(self.amount_name, numbers)

    @abstractmethod
    def choose(self, action_values: Tensor, amount: Tensor, u: Tensor) -> Tensor:
        """Choose an action in every state.

        Args:
            action_values: Q of the candidates, ``[candidates, runs, *batch]``.
            amount: the amount of exploration, ``[runs, *batch]`` or broadcast to it.
            u: uniform random numbers in [0, 1), ``[runs, *batch]``.

        Returns:
            The actions, ``[runs, *batch]``.
        """

    def probabilities(self, action_values: Tensor, amount: Tensor) -> Tensor:
        """Return the probability with which each candidate is chosen.

        Args:
            action_values, amount: as in :meth:`choose`.

        Returns:
            ``[candidates, runs, *batch]``.

        Raises:
            NotImplementedError: if the policy doesn't choose among the candidates.
        """
        raise NotImplementedError(f"{type(self).__name__} has actions besides the candidates")

    def amount(self, run: Mapping[str, Tensor], steps: Tensor) -> Tensor:
        """Return the amount of exploration after a number of learning steps, ``[runs, 1]``.

        Args:
            run: the values of the runs, with the amount under its own name.
            steps: the number of steps learned from, int64 ``[runs, 1]``.
        """
        return run[self.amount_name]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        network = self.value_network
        seen = per_run(tensordict[network.in_keys[0]])
        amount = over_batch(getattr(self, self.amount_name), like=seen)

        def choose(values: Tensor, u: Tensor) -> Tensor:
            return self.choose(values, amount, u)

        return tensordict.update(network.decide(tensordict, choose))


class EpsilonGreedyPolicy(ExploringPolicy):
    """The ε-greedy policy (:func:`fnnq_torchrl.equations.exploration.epsilon_greedy`).

    Args:
        value_network: Q(s, a), and the candidates.
        epsilon: ε, one number or one per run, ``[runs, 1]``.
    """

    amount_name = EXPLORATIONS["epsilon_greedy"]

    def __init__(self, value_network: ValueNetwork, epsilon: Tensor | float) -> None:
        super().__init__(value_network, epsilon)

    def choose(self, action_values: Tensor, amount: Tensor, u: Tensor) -> Tensor:
        chosen = exploration.epsilon_greedy(action_values, amount, u)
        return self.value_network.candidates[chosen]

    def probabilities(self, action_values: Tensor, amount: Tensor) -> Tensor:
        return exploration.epsilon_greedy_probabilities(action_values, amount)

    def amount(self, run: Mapping[str, Tensor], steps: Tensor) -> Tensor:
        """Return ε, which is annealed if ``run`` has ``epsilon_final`` and ``epsilon_over``."""
        if "epsilon_final" not in run:
            return run["epsilon"]
        return exploration.annealed(
            run["epsilon"], run["epsilon_final"], run["epsilon_over"], steps
        )


class BoltzmannPolicy(ExploringPolicy):
    """The Boltzmann (softmax) policy (:func:`fnnq_torchrl.equations.exploration.boltzmann`).

    Args:
        value_network: Q(s, a), and the candidates.
        temperature: T > 0, one number or one per run, ``[runs, 1]``.
    """

    amount_name = EXPLORATIONS["boltzmann"]

    def __init__(self, value_network: ValueNetwork, temperature: Tensor | float) -> None:
        super().__init__(value_network, temperature)

    def choose(self, action_values: Tensor, amount: Tensor, u: Tensor) -> Tensor:
        chosen = exploration.boltzmann(action_values, amount, u)
        return self.value_network.candidates[chosen]

    def probabilities(self, action_values: Tensor, amount: Tensor) -> Tensor:
        return exploration.boltzmann_probabilities(action_values, amount)


class NoisyPolicy(ExploringPolicy):
    """The best candidate plus normal noise (:func:`.exploration.noisy_greedy`).

    Args:
        value_network: Q(s, a), and the candidates, ascending.
        noise_std: σ of the noise, one number or one per run, ``[runs, 1]``.

    Raises:
        ValueError: if the network's rules choose an action each, and know only the candidates.
    """

    amount_name = EXPLORATIONS["noise"]

    def __init__(self, value_network: ValueNetwork, noise_std: Tensor | float) -> None:
        if value_network.choice_key != "action":
            raise ValueError("exploration='noise': the rules must choose among the candidates")
        super().__init__(value_network, noise_std)

    def choose(self, action_values: Tensor, amount: Tensor, u: Tensor) -> Tensor:
        candidates = self.value_network.candidates
        return exploration.noisy_greedy(action_values, candidates, amount, u)


POLICIES: dict[str, type[ExploringPolicy]] = {
    "epsilon_greedy": EpsilonGreedyPolicy,
    "boltzmann": BoltzmannPolicy,
    "noise": NoisyPolicy,
}
"""The policies by their names (:data:`fnnq_torchrl.equations.names.EXPLORATIONS`)."""


def policy_class(name: str) -> type[ExploringPolicy]:
    """Return the policy with the given name.

    Args:
        name: a name in `POLICIES`, or ``module:Class`` of a user's policy.

    Raises:
        ConfigError: if there is no such policy, or the user's class can't be imported or isn't an
            :class:`ExploringPolicy`.
    """
    if name not in POLICIES and not is_own(name):
        raise OutOfRange("exploration", name, kinds_in_words(POLICIES))
    return class_of("exploration", name, POLICIES, ExploringPolicy)


def make_policy(name: str, value_network: ValueNetwork, amount: Tensor | float) -> ExploringPolicy:
    """Make the policy with the given name.

    Args:
        name: as in :func:`policy_class`.
        value_network: Q(s, a), and the candidates.
        amount: the amount of exploration, one number or one per run, ``[runs, 1]``.

    Raises:
        ConfigError: as in :func:`policy_class`.
    """
    return policy_class(name)(value_network, amount)
