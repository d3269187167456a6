"""Autostep: IDBD whose meta step size needs no tuning. The runs are the last dimension.

Source: A. R. Mahmood, R. S. Sutton, T. Degris, P. M. Pilarski, "Tuning-free step-size adaptation",
ICASSP 2012, table 1. Autostep learns a target from linear features, as IDBD does; what
:mod:`.idbd` says about traces holds here, too. :func:`.tidbd.auto_tidbd` is Autostep for traces.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from .base import Numbers, State, Step, Stepped, StepSize, filled, mean, total


class Autostep(StepSize):
    """A step size for each weight by :func:`autostep`."""

    numbers = ("meta_step_size", "tau")

    def start(self, alpha: Tensor, weights: Sequence[Tensor]) -> State:
        return {
            "alpha": filled(alpha, weights),
            "memory": [torch.zeros_like(w) for w in weights],
            "scale": [torch.zeros_like(w) for w in weights],
        }

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        state = autostep(
            state, step.gradients, step.error, numbers["meta_step_size"], numbers["tau"]
        )
        return Stepped(step.credited(), state["alpha"], mean(state["alpha"]), state)


def autostep(
    state: State, features: Sequence[Tensor], error: Tensor, meta_step_size: Tensor, tau: Tensor
) -> State:
    """Return α, the memory h and the scale v after a step, for all weights.

        v ← max(|δxh|, v + αx²(|δxh| − v)/τ)
        α ← α exp(μδxh/v) where v > 0
        α ← α / max(Σαx², 1), the sum over all weights
        (w ← w + αδx);   h ← h(1 − αx²) + αδx

    v is a decaying maximum of the size of α's own gradient, by which that gradient is divided. The
    bound on Σαx² keeps a step from overshooting its target. Mahmood et al. 2012, table 1.

    Args:
        state: ``alpha``, ``memory`` and ``scale``, tensors ``[*weights, runs]`` each.
        features: x, tensors ``[*weights, runs]``.
        error: δ, ``[runs]``.
        meta_step_size: μ, ``[runs]``.
        tau: τ, in updates of a weight whose αx² is 1, ``[runs]``.
    """
    grown, scales = [], []
    for alpha, h, v, x in zip(*_tensors(state), features, strict=True):
        slope = error * x * h
        scale = torch.maximum(slope.abs(), v + alpha * x.square() * (slope.abs() - v) / tau)
        grown.append(alpha * (meta_step_size * normalised(slope, scale)).exp())
        scales.append(scale)
    squares = [x.square() for x in features]
    effective = total([alpha * square for alpha, square in zip(grown, squares, strict=True)])
    alphas = [alpha / effective.clamp(min=1) for alpha in grown]
    memories = [
        h * (1 - alpha * x.square()) + alpha * error * x
        for alpha, h, x in zip(alphas, state["memory"], features, strict=True)
    ]
    return {"alpha": alphas, "memory": memories, "scale": scales}


def normalised(slope: Tensor, scale: Tensor) -> Tensor:
    """Return slope/scale, and 0 where the scale is 0."""
    return torch.where(scale > 0, slope / scale, 0)


def _tensors(state: State) -> tuple[Sequence[Tensor], ...]:
    return state["alpha"], state["memory"], state["scale"]
