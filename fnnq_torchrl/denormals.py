"""Runs whose weights have become so small that numbers lose their precision."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor

_NAMED = 5
"""Seeds that are named; the others are counted."""


def denormal_runs(weights: TensorDictBase) -> Tensor:
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


def told(seeds: Sequence[int]) -> str:
    """One line on such runs, by their seeds."""
    named = ", ".join(map(str, seeds[:_NAMED]))
    more = f" and {len(seeds) - _NAMED:,} more" if len(seeds) > _NAMED else ""
    return (
        f"seed{'s' if len(seeds) > 1 else ''} {named}{more}: some weights are subnormal numbers, "
        "too small for full precision; machine.dtype=float64 has smaller ones"
    )
