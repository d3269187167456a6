"""Q(s, a) as a multilayer perceptron (MLP)."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Self

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from envs.core import streams
from envs.core.streams import Stream
from fnnq_torchrl.config.values import OUTPUTS, MLPConfig
from fnnq_torchrl.equations.normalisation import Moments, normalised

from .base import ValueNetwork

_ACTIVATIONS: dict[str, Callable[[Tensor], Tensor]] = {
    "tanh": torch.tanh,
    "relu": torch.relu,
    "leaky_relu": nn.functional.leaky_relu,
}

_STATISTICS = tuple(f"seen_{field}" for field in Moments._fields)

_NORM_EPSILON = 1e-5  # the default of torch's LayerNorm


class MLPValue(ValueNetwork):
    """A multilayer perceptron from the observations, and the action, to Q.

    Every run has its own weights and biases, ``weight_i`` ``[runs, outputs, inputs]`` and
    ``bias_i`` ``[runs, outputs]``. Biases start at 0. A unit with n incoming weights starts with
    some of them at 0 and the others drawn from U(−1/√n, 1/√n) with the run's seed.

    With ``normalise``, the network subtracts from each observation its running mean and divides it
    by its running standard deviation. The statistics are ``seen_samples``, ``seen_mean`` and
    ``seen_squares``, the fields of :class:`fnnq_torchrl.equations.normalisation.Moments`, each
    ``[runs, inputs]``.

    Source of the sparse start, of the layer normalisation (before the activation, without
    parameters) and of the running normalisation: M. Elsayed, G. Vasan, A. R. Mahmood, "Streaming
    deep reinforcement learning finally works", 2024.

    Args:
        in_keys: the keys of the observations that the network takes.
        candidates: the candidate actions, ``[candidates]``, in the network's dtype and device.
        widths: the number of units in each hidden layer.
        activation: ``tanh``, ``relu`` or ``leaky_relu``.
        layer_norm: whether hidden layers are normalised before the activation.
        sparsity: the share of a unit's incoming weights that start at 0, in [0, 1]. The number of
            zeros is rounded up, but at least one weight isn't 0.
        outputs: ``one``: the action is an input, and the output is its Q. ``each``: there is an
            output for each candidate; then only candidates have a value.
        normalise: whether observations are normalised by their running mean and variance.
        runs: the number of runs in the batch; a network of one run takes inputs of any batch size.
            The parameters are drawn with the seeds 0, 1, ….

    Raises:
        ValueError: if there is no such activation, or no such kind of outputs.
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
        outputs: str = "one",
        normalise: bool = False,
        runs: int = 1,
    ) -> None:
        super().__init__(list(in_keys), candidates)
        if activation not in _ACTIVATIONS:
            raise ValueError(f"activation={activation!r}: must be one of {', '.join(_ACTIVATIONS)}")
        if outputs not in OUTPUTS:
            raise ValueError(f"outputs={outputs!r}: must be {' or '.join(OUTPUTS)}")
        self._activation, self._layer_norm = _ACTIVATIONS[activation], layer_norm
        self._of_each = outputs == "each"
        ends = (0, len(candidates)) if self._of_each else (1, 1)
        self._sizes = [*pairwise([len(in_keys) + ends[0], *widths, ends[1]])]
        self._sparsity = sparsity
        self.statistics = _STATISTICS if normalise else ()
        seeds = torch.arange(runs, device=candidates.device).unsqueeze(-1)
        for name, start in self.start(seeds).items():
            if name in self.statistics:
                self.register_buffer(name, start)
            else:
                self.register_parameter(name, nn.Parameter(start))

    @classmethod
    def from_config(cls, config: MLPConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            candidates,
            widths=config.widths,
            activation=config.activation,
            layer_norm=config.layer_norm,
            sparsity=config.sparsity,
            outputs=config.outputs,
            normalise=config.normalise,
            runs=runs,
        )

    def start(self, seed: Tensor) -> dict[str, Tensor]:
        weights: dict[str, Tensor] = {}
        for layer, (inputs, outputs) in enumerate(self._sizes):
            first, second = _uniforms(seed, layer, outputs * inputs, self.candidates.dtype)
            shape = (len(seed), outputs, inputs)
            weight = (2 * first.view(shape) - 1) / math.sqrt(inputs)
            zeros = min(inputs - 1, math.ceil(self._sparsity * inputs))
            place = second.view(shape).argsort(-1).argsort(-1)  # random order within a unit
            weights[f"weight_{layer}"] = torch.where(place < zeros, 0, weight)
            weights[f"bias_{layer}"] = weight.new_zeros(shape[:2])
        nothing = self.candidates.new_zeros(len(seed), len(self.in_keys))
        return weights | {name: nothing.clone() for name in self.statistics}

    def observed(self, state: TensorDictBase) -> dict[str, Tensor]:
        if not self.statistics:
            return {}
        before = Moments(*(state.get(name, getattr(self, name)) for name in self.statistics))
        after = before.with_sample(torch.cat([state[key] for key in self.in_keys], -1))
        return dict(zip(self.statistics, after, strict=True))

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        state = torch.cat(observations, -1)
        if self.statistics:
            shape = (-1, *[1] * (state.ndim - 2), state.shape[-1])
            seen = Moments(*(getattr(self, name).view(shape) for name in self.statistics))
            state = normalised(state, seen)
        if self._of_each:
            values = self._through_the_layers(state.unsqueeze(-2)).squeeze(-2)
            if action is None:
                return values
            return torch.where(action == self.candidates, values, 0).sum(-1, keepdim=True)
        actions = self.candidates if action is None else action
        actions = actions.unsqueeze(-1).expand(*state.shape[:-1], -1, 1)
        state = state.unsqueeze(-2).expand(*actions.shape[:-1], -1)
        return self._through_the_layers(torch.cat([state, actions], -1)).squeeze(-1)

    def _through_the_layers(self, seen: Tensor) -> Tensor:
        """Return the output of the last layer, from ``[runs, *batch, inputs]``."""
        hidden = seen.flatten(1, -2)  # [runs, batch, inputs]
        for layer in range(len(self._sizes)):
            if layer:
                hidden = self._activation(_normalised(hidden) if self._layer_norm else hidden)
            weight = getattr(self, f"weight_{layer}").transpose(1, 2)
            hidden = torch.matmul(hidden, weight) + getattr(self, f"bias_{layer}").unsqueeze(1)
        return hidden.view(*seen.shape[:-1], -1)


def _uniforms(seed: Tensor, layer: int, count: int, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Return two U[0, 1) numbers for each of ``count`` weights, as two ``[runs, count]``."""
    # The worlds use the stream START at step 0 only, so all later steps are unused.
    step = 1 + torch.arange(count, device=seed.device).expand(len(seed), -1)
    words = streams.draw(seed.expand_as(step), torch.full_like(step, layer), step, Stream.START)
    return streams.uniform(words[0], dtype), streams.uniform(words[1], dtype)


def _normalised(hidden: Tensor) -> Tensor:
    """Return the tensor normalised to mean 0 and variance 1 over the last dimension."""
    centred = hidden - hidden.mean(-1, keepdim=True)
    return centred * (centred.square().mean(-1, keepdim=True) + _NORM_EPSILON).rsqrt()
