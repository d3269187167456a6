"""The two errors of Q(λ) and the one-step loss, as a TorchRL LossModule."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor, nn
from torchrl.objectives import LossModule

from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.equations import q_lambda
from fnnq_torchrl.equations.layout import over_batch, run_numbers
from fnnq_torchrl.equations.names import BOOTSTRAPS

Values = Callable[[Tensor | None], Tensor]
"""A function that returns Q of a given action, ``[runs, *batch, 1]``, or, for None, of all."""


class Errors(NamedTuple):
    """The two errors of a step, Q(s, a) and V(s′), each ``[runs, *batch, 1]``.

    Attributes:
        td_error: δ, without a gradient.
        chosen_td_error: δ′, without a gradient.
        chosen_value: Q(s, a), with the gradient of the network's weights.
        next_value: V(s′), without a gradient.
    """

    td_error: Tensor
    chosen_td_error: Tensor
    chosen_value: Tensor
    next_value: Tensor


class PengQLambdaLoss(LossModule):
    """The two errors of Peng's Q(λ), and the loss of one-step Q-learning.

    ``loss`` is ½Σδ′² over the runs. Because it is a sum, a run's weights have the gradient
    −δ′∇Q(s, a) of that run alone. Plain SGD on this loss is Q(0); with
    :class:`fnnq_torchrl.agent.eligibility_trace.EligibilityTrace` it is Q(λ).

    The module reads the network's observations, ``action`` and ``action_value``, and in ``"next"``
    the observations, ``reward`` and ``terminated`` (the trace also reads ``done``).
    ``action_value`` is the policy's Q(s, ·) of all candidates, from the weights before the update.
    ``set_keys`` renames every key except the observations.

    The module returns a TensorDict with ``loss``, a scalar, and with ``td_error`` δ,
    ``chosen_td_error`` δ′, ``chosen_action_value`` Q(s, a) and ``next_value`` V(s′), each
    ``[runs, *batch, 1]``.

    Args:
        value_network: Q(s, a), any :class:`ValueNetwork`.
        gamma: the discount γ, one number or one per run, ``[runs, 1]``.
        bootstrap: V(s′), the value of the next state. ``best``: max Q(s′, ·), for Q(λ). ``chosen``:
            Q(s′, a′) of the ``action`` in ``"next"``, for Sarsa(λ), which must take this action in
            the next step. ``expected``: the mean of Q(s′, ·), weighted by the
            ``action_probability`` of each candidate in ``"next"``.

    Raises:
        ValueError: if there is no such bootstrap, or it doesn't suit the network.
    """

    @dataclass
    class _AcceptedKeys:
        action: NestedKey = "action"
        action_value: NestedKey = "action_value"
        reward: NestedKey = "reward"
        done: NestedKey = "done"
        terminated: NestedKey = "terminated"
        td_error: NestedKey = "td_error"
        chosen_td_error: NestedKey = "chosen_td_error"
        chosen_action_value: NestedKey = "chosen_action_value"
        action_probability: NestedKey = "action_probability"
        next_value: NestedKey = "next_value"

    default_keys = _AcceptedKeys
    value_network: ValueNetwork
    gamma: Tensor

    def __init__(
        self, value_network: ValueNetwork, gamma: Tensor | float, bootstrap: str = "best"
    ) -> None:
        super().__init__()
        if bootstrap not in BOOTSTRAPS:
            *others, last = BOOTSTRAPS
            raise ValueError(f"bootstrap={bootstrap!r}: must be {', '.join(others)} or {last}")
        if bootstrap != "best" and value_network.choice_key != "action":
            raise ValueError(f"bootstrap={bootstrap!r}: must be best if each rule has an action")
        self.bootstrap = bootstrap
        self.value_network = value_network
        self.set_keys(action=value_network.choice_key)
        candidates = value_network.candidates
        self.register_buffer("gamma", run_numbers("gamma", gamma, like=candidates))

    def named_parameters(self, *args: Any, **kwargs: Any) -> Iterator[tuple[str, nn.Parameter]]:
        # functional_call passes ``remove_duplicate``, which LossModule's method doesn't take.
        return nn.Module.named_parameters(self, *args, **kwargs)

    def _forward_value_estimator_keys(self, **kwargs: Any) -> None:
        pass  # a one-step target needs no value estimator

    @property
    def in_keys(self) -> list[NestedKey]:
        keys, observations = self.tensor_keys, self.value_network.in_keys
        of_bootstrap = {"best": [], "chosen": [keys.action], "expected": [keys.action_probability]}
        after = [*observations, keys.reward, keys.terminated, *of_bootstrap[self.bootstrap]]
        return [*observations, keys.action, keys.action_value, *(("next", key) for key in after)]

    @property
    def out_keys(self) -> list[NestedKey]:
        keys = self.tensor_keys
        of_pair = [keys.td_error, keys.chosen_td_error, keys.chosen_action_value]
        return ["loss", *of_pair, keys.next_value]

    def next_value(self, values: Values, after: TensorDictBase) -> Tensor:
        """Return V(s′), ``[runs, *batch, 1]``.

        Args:
            values: the function that returns Q(s′, ·).
            after: the TensorDict under ``"next"``.
        """
        if self.bootstrap == "chosen":
            return values(after[self.tensor_keys.action])
        if self.bootstrap == "expected":
            mean = values(None) * after[self.tensor_keys.action_probability]
            return mean.sum(-1, keepdim=True)
        return self.value_network.best(values(None))

    def errors(self, tensordict: TensorDictBase, gamma: Tensor | None = None) -> Errors:
        """Return the errors and values of a step; :meth:`forward` makes the loss from them.

        Args:
            tensordict: the step, as in :meth:`forward`.
            gamma: γ in this step, ``[runs, 1]``; by default the module's.
        """
        keys, network, after = self.tensor_keys, self.value_network, tensordict["next"]
        chosen_value = network.values_in(tensordict, tensordict[keys.action])
        with torch.no_grad():
            next_value = self.next_value(partial(network.values_in, after), after)
            td_error, chosen_td_error = q_lambda.td_errors(
                after[keys.reward],
                after[keys.terminated],
                network.best(tensordict[keys.action_value]),
                chosen_value,
                next_value,
                over_batch(self.gamma if gamma is None else gamma, like=chosen_value),
            )
        return Errors(td_error, chosen_td_error, chosen_value, next_value)

    def forward(self, tensordict: TensorDictBase) -> TensorDict:
        keys = self.tensor_keys
        td_error, chosen_td_error, chosen_value, next_value = self.errors(tensordict)
        target = chosen_td_error + chosen_value.detach()
        return TensorDict(
            {
                "loss": 0.5 * (target - chosen_value).square().sum(),
                keys.td_error: td_error,
                keys.chosen_td_error: chosen_td_error,
                keys.chosen_action_value: chosen_value,
                keys.next_value: next_value,
            }
        )
