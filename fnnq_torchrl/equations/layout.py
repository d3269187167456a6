"""Two orders of dimensions: TensorDicts have the runs first, the arithmetic has them last.

Runs-last, sums over rules and candidates unroll into a few vectorised loops over the runs. The
TensorDict faces move the dimension at their edge: a view, it costs nothing.
"""

import torch
from torch import Tensor


def runs_last(tensor: Tensor) -> Tensor:
    """``[runs, *rest]`` as ``[*rest, runs]``."""
    return tensor.movedim(0, -1)


def runs_first(tensor: Tensor) -> Tensor:
    """``[*rest, runs]`` as ``[runs, *rest]``."""
    return tensor.movedim(-1, 0)


def per_run(tensor: Tensor) -> Tensor:
    """A number of each run, ``[runs, 1]``, as ``[runs]``; a number shared by all stays as it is."""
    return tensor.squeeze(-1)


def over_batch(numbers: Tensor, like: Tensor) -> Tensor:
    """A number of each run, ``[runs, 1]``, or of all, to broadcast with ``[runs, *batch]``.

    Args:
        numbers: ``[runs, 1]`` or a single one.
        like: what it is to broadcast with, at least one dimension.
    """
    return numbers.reshape(-1, *[1] * (like.ndim - 1))


def run_numbers(name: str, value: Tensor | float, like: Tensor) -> Tensor:
    """A hyper-parameter as a tensor.

    Args:
        name: what to call it if it is refused.
        value: one number for all runs, or one per run, ``[runs, 1]``.
        like: whose dtype and device it gets.

    Raises:
        ValueError: it has another shape.
    """
    numbers = torch.as_tensor(value, dtype=like.dtype, device=like.device)
    if numbers.ndim != 0 and (numbers.ndim != 2 or numbers.shape[1] != 1):
        raise ValueError(f"{name} must be one number or [runs, 1], got {list(numbers.shape)}")
    return numbers
