"""Gradients of a learning step besides ∇Q(s, a): only some traces and step sizes need them."""

from tensordict import TensorDictBase
from torch import Tensor
from torch.func import functional_call

from fnnq_torchrl.agent.gradient import Weights, gradient
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.equations.layout import per_run, runs_last


def slope_of_all(loss: PengQLambdaLoss, weights: Weights, transition: TensorDictBase) -> Weights:
    """Return each run's ∇ΣQ(s, ·) over all candidates, by name, for a trace that clears.

    Args:
        loss: the loss, with the network.
        weights: the weights, by name.
        transition: the step, with the observations of s.
    """
    network = loss.value_network

    def every_value(weights: Weights) -> tuple[Tensor, None]:
        observations = tuple(transition[key] for key in network.in_keys)
        return functional_call(network, weights, observations), None

    return gradient(every_value, weights)[0]


def error_slope(
    loss: PengQLambdaLoss, weights: Weights, gamma: Tensor, slope: Weights, after: TensorDictBase
) -> list[Tensor]:
    """Return ∇δ′ = γ∇V(s′) − ∇Q(s, a), tensors ``[*weights, runs]``.

    ∇V is 0 if s′ ends the task. If V is a maximum, ∇V is the mean over the best actions.

    Args:
        loss: the loss, with the network.
        weights: the weights, by name.
        gamma: γ in this step, ``[runs, 1]``.
        slope: ∇Q(s, a), by name.
        after: the entry ``"next"`` of the step.
    """
    network = loss.value_network

    def value(weights: Weights) -> tuple[Tensor, None]:
        observations = tuple(after[key] for key in network.in_keys)
        given = weights | {name: after[name] for name in network.statistics}

        def values(action: Tensor | None) -> Tensor:
            found: Tensor = functional_call(network, given, observations, {"action": action})
            return found

        return loss.next_value(values, after).masked_fill(after["terminated"], 0), None

    ahead, _ = gradient(value, weights)
    return [per_run(gamma) * runs_last(ahead[name]) - runs_last(slope[name]) for name in slope]
