"""Torch's threads: how many an operation is worth, and how they treat the smallest numbers."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_GRAIN = 2**15
"""Elements below which torch itself keeps most of its operations on one thread."""


_SUBNORMAL = 1e-40
"""Of float32: below 2⁻¹²⁶."""


@contextmanager
def threads_for(elements: int) -> Iterator[None]:
    """One thread for small tensors, all of torch's threads for large ones.

    Not all operations look at their size: a softmax wakes every thread for a hundred numbers, and
    where other programs want the cores too it waits for milliseconds.

    Args:
        elements: of the largest tensors in the block.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1 if elements < _GRAIN else before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def subnormals_flushed() -> Iterator[None]:
    """Numbers too small for all their digits count as zero in the block, as in native loops.

    Traces fall to such numbers within some fifty steps, and processors are slow with them. The
    setting belongs to the thread that asks for it and is put back at the end. Threads that torch
    starts in the block inherit it; those that it started before keep their own.
    """
    before = bool(torch.full((), _SUBNORMAL) * 1 == 0)
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(before)
