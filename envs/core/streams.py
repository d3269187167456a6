"""Counter-based random numbers: a draw depends on who asks and when, not on earlier draws.

Every draw is a hash of the run's seed and of the episode, the step and the stream that it is for,
so a run's random numbers are the same alone, in any batch, in any order and on any device, and
there is no generator state to save.

The hash is pcg4d, from four 32-bit words to four, with a round more: with its own two rounds the
low bits of neighbouring runs and episodes are not independent, with three no test finds any fault
(``tests/envs/core/test_streams.py``). It multiplies 32-bit integers only, of which AVX2 does eight
at a time; the 64-bit products of SplitMix64 or Philox it does one by one.

Source: M. Jarzynski, M. Olano, "Hash functions for GPU rendering", Journal of Computer Graphics
Techniques 9(3), 2020.
"""

import math
from enum import IntEnum

import torch
from torch import Tensor

Words = tuple[Tensor, Tensor, Tensor, Tensor]
"""A block of random words, 32 bits each: int32 tensors."""


class Stream(IntEnum):
    """The purposes of random words. Streams share none; there is room for one more."""

    STEP = 0
    START = 1
    CHANCE = 2
    LAYOUT = 3
    SENSORS = 4


def pcg4d(x: Tensor, y: Tensor, z: Tensor, w: Tensor) -> Words:
    """The hash of four words: each bit changes about half of the 128.

    Args:
        x, y, z, w: int32, any one shape. Products and sums wrap, as they should.
    """
    words = _couple(*(1664525 * word + 1013904223 for word in (x, y, z, w)))
    for _ in range(2):
        words = _couple(*(word ^ ((word >> 16) & 0xFFFF) for word in words))
    return words


def _couple(x: Tensor, y: Tensor, z: Tensor, w: Tensor) -> Words:
    """Each word depends on each other."""
    x = torch.addcmul(x, y, w)
    y = torch.addcmul(y, z, x)
    z = torch.addcmul(z, x, y)
    w = torch.addcmul(w, y, z)
    return x, y, z, w


def draw(seed: Tensor, episode: Tensor, step: Tensor, stream: Stream) -> Words:
    """Four random 32-bit words of a run, at a step of one of its episodes.

    Args:
        seed: the runs' seeds, int64 in [0, 2⁶³), any shape.
        episode: int64 in [0, 2³³), same shape.
        step: int64 in [0, 2²⁹), same shape.
        stream: what the words are for.

    Returns:
        Four int32 tensors of that shape.
    """
    upper = (seed >> 32) | ((episode >> 32) << 31)  # 31 bits of the seed, one of the episode
    # The first two streams take turns in the lower half of the counter, the others have a quarter
    # of its upper half each.
    counter = 2 * step + stream if stream < 2 else 2**31 + (stream - 2) * 2**29 + step
    low_bits = (number.to(torch.int32) for number in (seed, upper, episode, counter))
    return pcg4d(*low_bits)


def uniform(word: Tensor, dtype: torch.dtype) -> Tensor:
    """U[0, 1) from a word's upper 24 bits: exact, and so the same, in float32 and float64."""
    return ((word >> 8) & 0xFFFFFF).to(dtype) * 2.0**-24


def spare_uniform(words: tuple[Tensor, ...], dtype: torch.dtype) -> Tensor:
    """U[0, 1) from the lowest bytes of three words, which :func:`uniform` leaves alone."""
    high, middle, low = (word & 0xFF for word in words)
    return ((high << 16) | (middle << 8) | low).to(dtype) * 2.0**-24


def coin(word: Tensor) -> Tensor:
    """A fair coin (bool) from the word's lowest bit, which :func:`uniform` leaves alone."""
    return (word & 1).bool()


def normal(word: Tensor, other: Tensor, dtype: torch.dtype) -> Tensor:
    """N(0, 1) from two words, by Box and Muller's transform."""
    radius = torch.sqrt(-2 * torch.log(1 - uniform(word, dtype)))
    return radius * torch.cos(2 * math.pi * uniform(other, dtype))
