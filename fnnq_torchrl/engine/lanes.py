"""Runs as lanes of a batch whose size is a multiple of the machine's vectors.

Vectorised kernels treat the rest of a vector's length differently (another code path, another order
of summation), so a run could differ, in its last bit, from the same run in another batch. With the
batch padded, every lane takes the same path. Padding lanes repeat the last run; they cost little
and are never reported.
"""

from typing import TypeVar

import torch
from tensordict import TensorDictBase
from torch import Tensor

Values = TypeVar("Values", Tensor, TensorDictBase)

LANES = 32
"""16 are not enough: tried on AVX2 and AVX-512."""


def repeat_last(values: Values, lanes: int) -> Values:
    """The first values of ``[runs, ...]``, the last repeated if need be: ``[lanes, ...]``."""
    index = torch.arange(lanes, device=values.device)
    return values[index.clamp(max=len(values) - 1)]


def lanes_for(jobs: int, workers: int, most: int) -> int:
    """How many lanes each worker should have for so many jobs.

    Enough that all jobs go on at once, at most ``most``, and one of few sizes, four from a number
    to its double: a compiled loop has the number of lanes built in, and is to be found again.
    """
    units = -(-jobs // (workers * LANES))
    grain = 1 << max(0, (units - 1).bit_length() - 3)
    return min(most, -(-units // grain) * grain * LANES)
