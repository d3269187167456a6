"""Runs whose weights have become so small that numbers lose their precision."""

import torch
from tensordict import TensorDictBase
from torch import Tensor


def with_denormals(weights: TensorDictBase) -> Tensor:
    """Of each run, whether a weight is subnormal: not 0, and less than the smallest normal number.

    Such a number has fewer digits the smaller it is, and processors are slow at them.

    Args:
        weights: by name, ``[runs, *weight]``.

    Returns:
        bool ``[runs]``, on the CPU.
    """
    subnormal = [
        ((weight != 0) & (weight.abs() < torch.finfo(weight.dtype).tiny)).flatten(1).any(dim=1)
        for weight in weights.values()
    ]
    return torch.stack(subnormal).any(dim=0).cpu()
