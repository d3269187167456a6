"""Batches of lanes whose size is a multiple of the processor's vector length.

A lane is the place of one run in a batch. Vectorised kernels handle a last, incomplete vector by
another code path with another order of summation, so the last bit of a run could depend on the
batch size. Padding the batch sends every lane down the same path. Padding lanes repeat the last
run, and their results are dropped.
"""

from typing import TypeVar

import torch
from tensordict import TensorDictBase
from torch import Tensor

Values = TypeVar("Values", Tensor, TensorDictBase)

LANES = 32
"""The unit of batch sizes. With 16, results differed in tests on AVX2 and AVX-512."""

_VECTOR = 8
"""The lanes of the shortest float32 vector of a native loop, which skips vectors without a job."""


def repeat_last(values: Values, lanes: int) -> Values:
    """Cut or pad a batch to a number of lanes, by repeating its last value.

    Args:
        values: ``[runs, ...]``.
        lanes: the number of lanes.

    Returns:
        ``[lanes, ...]``.
    """
    index = torch.arange(lanes, device=values.device)
    return values[index.clamp(max=len(values) - 1)]


def lanes_for(jobs: int, workers: int, most: int) -> int:
    """Return the number of lanes of each worker.

    It lets all jobs run at once, up to ``most``. It is rounded up to one of four sizes per
    doubling, because a loop may be compiled for one number of lanes and is cached by it.

    Args:
        jobs: the number of jobs.
        workers: the number of workers.
        most: the most lanes of a worker.
    """
    units = -(-jobs // (workers * LANES))
    grain = 1 << max(0, (units - 1).bit_length() - 3)
    return min(most, -(-units // grain) * grain * LANES)


def share(jobs: int, workers: int) -> int:
    """Return the most jobs that a worker begins with: equal shares, in whole vectors.

    It is at least `LANES`: with fewer jobs, collecting their results takes longer than their steps,
    and workers take turns with it.

    Args:
        jobs: the number of jobs.
        workers: the number of workers.
    """
    return max(LANES, -(-jobs // (workers * _VECTOR)) * _VECTOR)
