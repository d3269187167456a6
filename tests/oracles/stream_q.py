"""Stream Q(λ) for one run, which keeps all observations: the twin of the learner with statistics.

M. Elsayed, G. Vasan, A. R. Mahmood, "Streaming deep reinforcement learning finally works", 2024,
with Watkins' trace, which is cut before an exploratory action is credited.
"""

from collections.abc import Iterator, Mapping
from statistics import mean, variance

import torch
from torch import Tensor
from torch.nn import functional

from envs import PureEnv

from .peng import epsilon_greedy

Layers = list[Tensor]  # weight and bias of each layer in turn


def normal(rows: list[list[float]]) -> Tensor:
    """Return the last of the rows, normalised by the mean and variance of all of them."""
    columns = [*zip(*rows, strict=True)]
    spreads = [variance(column) if len(column) > 1 else 1.0 for column in columns]
    row = [
        (column[-1] - mean(column)) / (spread + 1e-8) ** 0.5
        for column, spread in zip(columns, spreads, strict=True)
    ]
    return torch.tensor(row, dtype=torch.float64)


def values_of(layers: Layers, seen: Tensor) -> Tensor:
    """Return Q of each action, with normalised layers and leaky relus."""
    hidden = seen
    for number in range(0, len(layers), 2):
        if number:
            hidden = functional.leaky_relu(functional.layer_norm(hidden, hidden.shape))
        hidden = layers[number] @ hidden + layers[number + 1]
    return hidden


def stream_q(
    env: PureEnv, weights: Mapping[str, Tensor], *, numbers: Mapping[str, float]
) -> Iterator[tuple[Layers, list[list[float]], list[float]]]:
    """Yield the weights, all observations and all discounted sums of rewards after each step.

    Args:
        env: the world of a single run, ``[1]``.
        weights: the run's first weights, by the names of the network's parameters.
        numbers: alpha, kappa, gamma, lam and epsilon.
    """
    layers = [
        weights[f"{kind}_{number}"].clone().requires_grad_()
        for number in range(len(weights) // 2)
        for kind in ("weight", "bias")
    ]
    alpha, kappa, gamma, lam, epsilon = (
        numbers[key] for key in ("alpha", "kappa", "gamma", "lam", "epsilon")
    )
    traces = [torch.zeros_like(layer) for layer in layers]
    rows: list[list[float]] = []
    sums: list[float] = []

    def see(state) -> Tensor:
        rows.append([state[key].item() for key in env.seen])
        return normal(rows)

    state = env.reset()
    seen = see(state)
    while True:
        values = values_of(layers, seen)
        action = epsilon_greedy(values.tolist(), epsilon, state["chance"].item())
        after = env.step(state.set("action", torch.tensor([[action]], dtype=torch.float64)))["next"]
        then = see(after)
        reward, done = after["reward"].item(), bool(after["done"])
        before = 0.0 if done or not sums else sums[-1]
        sums.append(gamma * before + reward)
        spread = variance(sums) if len(sums) > 1 else 1.0
        ahead = 0.0 if after["terminated"] else gamma * values_of(layers, then).max().item()
        error = reward / (spread + 1e-8) ** 0.5 + ahead - values[action].item()
        greedy = values[action] == values.max()
        slopes = torch.autograd.grad(values[action], layers)
        traces = [
            (gamma * lam * trace if greedy else 0) + slope
            for trace, slope in zip(traces, slopes, strict=True)
        ]
        norm = sum(trace.abs().sum().item() for trace in traces)
        step = alpha / max(1.0, alpha * kappa * max(abs(error), 1.0) * norm)
        layers = [
            (layer + step * error * trace).detach().requires_grad_()
            for layer, trace in zip(layers, traces, strict=True)
        ]
        if done:
            traces = [torch.zeros_like(layer) for layer in layers]
        state, seen = env.restart(after), then
        if done:
            seen = see(state)
        yield layers, rows, sums
