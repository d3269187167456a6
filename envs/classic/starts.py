"""Random starts of the classic worlds."""

from collections.abc import Sequence

import torch
from torch import Tensor

from envs.core import streams
from envs.core.pure import Entries
from envs.core.streams import Stream


def draw_state(
    keys: Sequence[str], largest: float, seed: Tensor, episode: Tensor, dtype: torch.dtype
) -> Entries:
    """Draw each number of a state from U(−largest, largest).

    Args:
        keys: the names of the state's four numbers.
        largest: the bound of every number, in the number's own unit.
        seed, episode: int64 ``[*batch_size, 1]``.
        dtype: the dtype of the numbers.

    Returns:
        The numbers by name, each ``[*batch_size, 1]``.
    """
    words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
    return {
        key: largest * (2 * streams.uniform(word, dtype) - 1)
        for key, word in zip(keys, words, strict=True)
    }
