"""Two orders of dimensions: TensorDicts have the runs first, the equations have them last.

With the runs last, sums over rules and candidates unroll into a few vectorised loops over the runs.
Modules that read TensorDicts move the dimension; the result is a view, so this is free.
"""

import torch
from torch import Tensor


def runs_last(tensor: Tensor) -> Tensor:
    """Return ``[runs, *rest]`` as ``[*rest, runs]``."""
    return tensor.movedim(0, -1) if tensor.ndim > 1 else tensor


def runs_first(tensor: Tensor) -> Tensor:
    """Return ``[*rest, runs]`` as ``[runs, *rest]``."""
    return tensor.movedim(-1, 0)


def per_run(tensor: Tensor) -> Tensor:
    """Return one number per run, ``[runs, 1]``, as ``[runs]``, and a single number unchanged."""
    return tensor.squeeze(-1)


def over_batch(numbers: Tensor, like: Tensor) -> Tensor:
    """Return one number per run, or a single number, in a shape that broadcasts with ``like``.

    Args:
        numbers: ``[runs, 1]``, or a single number.
        like: the other tensor, ``[runs, *batch]``.
    """
    return numbers.reshape(-1, *[1] * (like.ndim - 1))


def run_numbers(name: str, value: Tensor | float, like: Tensor) -> Tensor:
    """Return a hyper-parameter as a tensor, one number or ``[runs, 1]``.

    Args:
        name: the hyper-parameter's name, for the error.
        value: one number for all runs, or one per run, ``[runs, 1]``.
        like: a tensor of the dtype and device of the result.

    Raises:
        ValueError: if the value has another shape.
    """
    numbers = torch.as_tensor(value, dtype=like.dtype, device=like.device)
    if numbers.ndim != 0 and (numbers.ndim != 2 or numbers.shape[1] != 1):
        raise ValueError(f"{name} must be one number or [runs, 1], got {list(numbers.shape)}")
    return numbers
