"""Counter-based random numbers: a draw depends on who asks and when, not on earlier draws.

Every draw is a hash of the run's seed and of the episode, the step and the stream that it is for,
so a run's random numbers are the same alone, in any batch, in any order and on any device, and
there is no generator state to save.

The hash is SplitMix64, whose n-th output mix(key + n·γ) needs no n − 1 outputs before it. A draw
takes less than half of the tensor operations of a Philox-4x32-10, which count in a learning step of
twenty weights.

Source: G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators",
OOPSLA'14, with the mixing function that they took from Java 8.
"""

import math
from enum import IntEnum

import torch
from torch import Tensor

_WORD = 0xFFFFFFFF

Words = tuple[Tensor, Tensor, Tensor, Tensor]
"""A block of random words: int64 tensors that each hold 32 bits."""


class Stream(IntEnum):
    """What a block of random words is for: one stream never lends its words to another."""

    STEP = 0
    START = 1


def _signed(number: int) -> int:
    """A number modulo 2⁶⁴ as int64 has it."""
    return (number + 2**63) % 2**64 - 2**63


_GAMMA = _signed(0x9E3779B97F4A7C15)  # 2⁶⁴ over the golden ratio
_BLOCK = _signed(2 * len(Stream) * _GAMMA)  # from a step's outputs to the next step's


def mix(z: Tensor) -> Tensor:
    """SplitMix64's mixing function, a bijection: each bit changes about half of the 64.

    Args:
        z: int64, any shape. Products wrap, as they should.
    """
    z = (z ^ _shift(z, 30)) * _signed(0xBF58476D1CE4E5B9)
    z = (z ^ _shift(z, 27)) * _signed(0x94D049BB133111EB)
    return z ^ _shift(z, 31)


def _shift(z: Tensor, bits: int) -> Tensor:
    """To the right, with zeros coming in."""
    return (z >> bits) & ((1 << 64 - bits) - 1)


def draw(seed: Tensor, episode: Tensor, step: Tensor, stream: Stream) -> Words:
    """Four random 32-bit words of a run, at a step of one of its episodes.

    Generators key generators. The outputs of a first one are the keys of the runs' (the seed says
    which output), theirs are the keys of the episodes', and of these every step has two outputs for
    each stream.

    Args:
        seed: the runs' seeds, int64 in [0, 2⁶³), any shape.
        episode: int64 in [0, 2⁶³), same shape.
        step: int64 in [0, 2³²), same shape.
        stream: what the words are for.

    Returns:
        Four int64 tensors of that shape, in [0, 2³²).
    """
    run = mix((seed + 1) * _GAMMA)
    key = mix(run + (episode + 1) * _GAMMA)
    counter = key + step * _BLOCK + _signed((2 * stream + 1) * _GAMMA)
    first, second = mix(counter), mix(counter + _GAMMA)
    return (first >> 32) & _WORD, first & _WORD, (second >> 32) & _WORD, second & _WORD


def uniform(word: Tensor, dtype: torch.dtype) -> Tensor:
    """U[0, 1) from a word's upper 24 bits: exact, and so the same, in float32 and float64."""
    return (word >> 8).to(dtype) * 2.0**-24


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
