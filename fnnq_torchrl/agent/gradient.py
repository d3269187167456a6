"""Gradients by the weights."""

from collections.abc import Callable
from typing import TypeVar

import torch
from torch import Tensor

Weights = dict[str, Tensor]
Aux = TypeVar("Aux")


def gradient(
    function: Callable[[Weights], tuple[Tensor, Aux]], weights: Weights
) -> tuple[Weights, Aux]:
    """The gradient of a function of the weights, and what else the function returns.

    By autograd: ``torch.func.grad``, which does the same, is slower where it runs eagerly.

    Args:
        function: from weights by name to a scalar and anything else, which holds no graph.
        weights: where to take the gradient, whether or not gradients are enabled.
    """
    with torch.enable_grad():
        leaves = {name: weight.detach().requires_grad_() for name, weight in weights.items()}
        value, aux = function(leaves)
        slopes = torch.autograd.grad(value, list(leaves.values()))
    return dict(zip(leaves, slopes, strict=True)), aux
