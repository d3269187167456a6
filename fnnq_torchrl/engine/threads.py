"""Torch's thread count, and its handling of subnormal numbers."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_GRAIN = 2**15
"""Most of torch's operations use one thread for fewer elements than this."""


_SUBNORMAL = 1e-40
"""A subnormal number of float32, which are those below 2⁻¹²⁶."""


@contextmanager
def threads_for(elements: int) -> Iterator[None]:
    """Give torch one thread for small tensors and all its threads for large ones, in the block.

    Some operations ignore their size: a softmax of a hundred numbers wakes every thread, which
    takes milliseconds when other programs use the cores too.

    Args:
        elements: the size of the largest tensors in the block.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1 if elements < _GRAIN else before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def subnormals_flushed() -> Iterator[None]:
    """Replace subnormal numbers by zero in the block, as native loops do.

    Eligibility traces decay to subnormal numbers within about fifty steps, and processors are slow
    with them. The setting holds for the calling thread and is restored at the end. Threads that
    torch starts within the block inherit it; threads that it started earlier don't.
    """
    before = bool(torch.full((), _SUBNORMAL, dtype=torch.float32) * 1 == 0)
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(before)
