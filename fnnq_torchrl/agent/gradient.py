"""Gradients with respect to the weights."""

from collections.abc import Callable
from typing import TypeVar

import torch
from torch import Tensor

Weights = dict[str, Tensor]
Aux = TypeVar("Aux")


def gradient(
    function: Callable[[Weights], tuple[Tensor, Aux]], weights: Weights
) -> tuple[Weights, Aux]:
    """Return the gradient of a function's sum over all runs, and the function's second result.

    If a run's value depends on its own weights alone, this is each run's own gradient.

    It uses ``torch.autograd.grad``, which is faster in eager mode than ``torch.func.grad``.

    Args:
        function: takes weights by name; returns values, whose sum is differentiated, and any second
            result.
        weights: the weights at which the gradient is taken; they need not require gradients.
    """
    with torch.enable_grad():
        leaves = {name: weight.detach().requires_grad_() for name, weight in weights.items()}
        values, aux = function(leaves)
        slopes = torch.autograd.grad(values, list(leaves.values()), torch.ones_like(values))
    return dict(zip(leaves, slopes, strict=True)), aux
