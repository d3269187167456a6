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
    """Return the gradient of a function of the weights, and the function's second result.

    By autograd, since ``torch.func.grad`` does the same more slowly in eager mode.

    Args:
        function: takes weights by name; returns a scalar and any second result without a graph.
        weights: the point of the gradient. Gradients needn't be enabled.
    """
    with torch.enable_grad():
        leaves = {name: weight.detach().requires_grad_() for name, weight in weights.items()}
        value, aux = function(leaves)
        slopes = torch.autograd.grad(value, list(leaves.values()))
    return dict(zip(leaves, slopes, strict=True)), aux
