"""How many threads an operation is worth."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_GRAIN = 2**15
"""Elements below which torch itself keeps most of its operations on one thread."""


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
