"""Counter-based random numbers: they depend on the run and the step, not on earlier draws.

Every draw is a hash of the run's seed, the episode, the step and the stream. So a run's random
numbers are the same alone, in any batch, in any order and on any device, and there is no generator
state to save.

The hash is pcg4d, which maps four 32-bit words to four, with three rounds instead of its two. After
two rounds the low bits of neighbouring runs and episodes depend on each other; after three no test
finds a dependence (``tests/envs/core/test_streams.py``). pcg4d multiplies only 32-bit integers:
eight at a time with AVX2. SplitMix64 and Philox need 64-bit products, which AVX2 doesn't have.

Source: M. Jarzynski, M. Olano, "Hash functions for GPU rendering", Journal of Computer Graphics
Techniques 9(3), 2020.
"""

import math
from collections.abc import Sequence
from enum import IntEnum

import torch
from torch import Tensor


class Stream(IntEnum):
    """The purposes of random words. No two streams share words; no other stream would fit.

    The learner's stream has the choices of rules. Perturbations have it, too, in the last episode,
    which no run reaches.
    """

    STEP = 0
    START = 1
    CHANCE = 2
    LAYOUT = 3
    SENSORS = 4
    LEARNER = 5


LAST_EPISODE = 2**33 - 1
"""The last episode for which :func:`draw` has words."""


def pcg4d(words: Tensor) -> Tensor:
    """Return the hash of four words; each input bit affects about half of its 128 bits.

    Args:
        words: int32 ``[4, ...]``. Products and sums wrap, as the hash requires.

    Returns:
        Four words, int32 ``[4, ...]``.
    """
    words = _coupled(1664525 * words + 1013904223)
    for _ in range(2):
        words = _coupled(words ^ ((words >> 16) & 0xFFFF))
    return words


def _coupled(words: Tensor) -> Tensor:
    """Return four words that each depend on all four given words."""
    x, y, z, w = words.unbind(0)
    x = torch.addcmul(x, y, w)
    y = torch.addcmul(y, z, x)
    z = torch.addcmul(z, x, y)
    w = torch.addcmul(w, y, z)
    return torch.stack([x, y, z, w])


def draw(seed: Tensor, episode: Tensor, step: Tensor, stream: Stream) -> Tensor:
    """Return four random 32-bit words for each run, at a step of an episode.

    Args:
        seed: the runs' seeds, int64 in [0, 2⁶³), any shape.
        episode: int64 in [0, 2³³), same shape.
        step: int64 in [0, 2²⁹), same shape.
        stream: the purpose of the words.

    Returns:
        Int32, ``[4, *shape]`` with the shape of ``seed``.
    """
    upper = (seed >> 32) | ((episode >> 32) << 31)  # 31 bits of the seed, one of the episode
    # The streams 0 and 1 alternate in the lower half of the counter's range. Each other stream has
    # a quarter of the upper half.
    counter = 2 * step + stream if stream < 2 else 2**31 + (stream - 2) * 2**29 + step
    # The conversion keeps the lower 32 bits.
    return pcg4d(torch.stack([seed, upper, episode, counter]).to(torch.int32))


def uniform(words: Tensor, dtype: torch.dtype) -> Tensor:
    """Return U[0, 1) from each word's upper 24 bits, which float32 and float64 hold exactly."""
    return ((words >> 8) & 0xFFFFFF).to(dtype) * 2.0**-24


def spare_uniform(words: Sequence[Tensor], dtype: torch.dtype) -> Tensor:
    """Return U[0, 1) from the lowest bytes of three words; :func:`uniform` ignores these bytes."""
    high, middle, low = (word & 0xFF for word in words)
    return ((high << 16) | (middle << 8) | low).to(dtype) * 2.0**-24


def coin(word: Tensor) -> Tensor:
    """Return a fair coin (bool) from a word's lowest bit; :func:`uniform` ignores this bit."""
    return (word & 1).bool()


def normal(word: Tensor, other: Tensor, dtype: torch.dtype) -> Tensor:
    """Return N(0, 1) from two words, by the Box–Muller transform."""
    return box_muller(*uniform(torch.stack([word, other]), dtype))


def box_muller(u: Tensor, v: Tensor) -> Tensor:
    """Return N(0, 1) from two independent numbers of U[0, 1)."""
    return torch.sqrt(-2 * torch.log(1 - u)) * torch.cos(2 * math.pi * v)
