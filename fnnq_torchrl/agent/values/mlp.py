"""Q(s, a) as a multilayer perceptron."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Self

import torch
from torch import Tensor, nn

from envs.core import streams
from envs.core.streams import Stream
from fnnq_torchrl.config.values import MLPConfig

from .base import ValueNetwork

_ACTIVATIONS: dict[str, Callable[[Tensor], Tensor]] = {
    "tanh": torch.tanh,
    "relu": torch.relu,
    "leaky_relu": nn.functional.leaky_relu,
}

_NORM_EPSILON = 1e-5  # as torch's LayerNorm has it


class MLPValue(ValueNetwork):
    """A multilayer perceptron from the observations and the action to Q.

    Every run has its own weights and biases, ``weight_i`` ``[runs, outputs, inputs]`` and
    ``bias_i`` ``[runs, outputs]``. At the start the biases are 0. Of the n incoming weights of a
    unit some are 0 and the others U(−1/√n, 1/√n), drawn from the run's seed.

    Source: sparse initialisation, and layer normalisation before the activation and without
    parameters, are those of M. Elsayed, G. Vasan, A. R. Mahmood, "Streaming deep reinforcement
    learning finally works", 2024.

    Args:
        in_keys: the observations that it takes, by their names in the TensorDict.
        candidates: the actions among which the best is sought, ``[candidates]``; their dtype and
            device are the network's.
        widths: units of each hidden layer.
        activation: ``tanh``, ``relu`` or ``leaky_relu``.
        layer_norm: whether hidden layers are normalised before the activation.
        sparsity: the share of every unit's incoming weights that are 0 at the start, in [0, 1];
            their number is rounded up, but one weight always remains.
        runs: the number of learners in the batch; a single one takes inputs of any batch size.
            Their parameters are those of the seeds 0, 1, ….

    Raises:
        ValueError: there is no such activation.
    """

    schema = MLPConfig

    def __init__(
        self,
        in_keys: Sequence[str],
        candidates: Tensor,
        *,
        widths: Sequence[int],
        activation: str,
        layer_norm: bool = False,
        sparsity: float = 0.0,
        runs: int = 1,
    ) -> None:
        super().__init__(list(in_keys), candidates)
        if activation not in _ACTIVATIONS:
            raise ValueError(f"activation={activation!r}: must be one of {', '.join(_ACTIVATIONS)}")
        self._activation, self._layer_norm = _ACTIVATIONS[activation], layer_norm
        self._sizes = [*pairwise([len(in_keys) + 1, *widths, 1])]
        self._sparsity = sparsity
        seeds = torch.arange(runs, device=candidates.device).unsqueeze(-1)
        for name, weight in self.start(seeds).items():
            self.register_parameter(name, nn.Parameter(weight))

    @classmethod
    def from_config(cls, config: MLPConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            candidates,
            widths=config.widths,
            activation=config.activation,
            layer_norm=config.layer_norm,
            sparsity=config.sparsity,
            runs=runs,
        )

    def start(self, seed: Tensor) -> dict[str, Tensor]:
        weights: dict[str, Tensor] = {}
        for layer, (inputs, outputs) in enumerate(self._sizes):
            first, second = _uniforms(seed, layer, outputs * inputs, self.candidates.dtype)
            shape = (len(seed), outputs, inputs)
            weight = (2 * first.view(shape) - 1) / math.sqrt(inputs)
            zeros = min(inputs - 1, math.ceil(self._sparsity * inputs))
            place = second.view(shape).argsort(-1).argsort(-1)  # each unit's, in random order
            weights[f"weight_{layer}"] = torch.where(place < zeros, 0, weight)
            weights[f"bias_{layer}"] = weight.new_zeros(shape[:2])
        return weights

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        state = torch.cat(observations, -1).unsqueeze(-2)  # [runs, *batch, 1, observations]
        actions = self.candidates if action is None else action
        actions = actions.unsqueeze(-1).expand(*state.shape[:-2], -1, 1)
        seen = torch.cat([state.expand(*actions.shape[:-1], -1), actions], -1)
        hidden = seen.flatten(1, -2)  # [runs, batch · actions, inputs]
        for layer in range(len(self._sizes)):
            if layer:
                hidden = self._activation(_normalised(hidden) if self._layer_norm else hidden)
            weight = getattr(self, f"weight_{layer}").transpose(1, 2)
            hidden = torch.matmul(hidden, weight) + getattr(self, f"bias_{layer}").unsqueeze(1)
        return hidden.view(actions.shape[:-1])


def _uniforms(seed: Tensor, layer: int, count: int, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Return two U[0, 1) numbers for each of ``count`` weights, ``[runs, count]`` each."""
    # The stream START is otherwise used at step 0 only, so the other steps are free.
    step = 1 + torch.arange(count, device=seed.device).expand(len(seed), -1)
    words = streams.draw(seed.expand_as(step), torch.full_like(step, layer), step, Stream.START)
    return streams.uniform(words[0], dtype), streams.uniform(words[1], dtype)


def _normalised(hidden: Tensor) -> Tensor:
    """Return the tensor with mean 0 and variance 1 over the last dimension."""
    centred = hidden - hidden.mean(-1, keepdim=True)
    return centred * (centred.square().mean(-1, keepdim=True) + _NORM_EPSILON).rsqrt()
