"""A sequence of random numbers for one step of a run."""

from collections.abc import Sequence

import torch
from torch import Tensor

from envs.core.streams import Stream, draw, uniform

BLOCKS = 64
"""The number of blocks of four random words that each step has in a stream."""


_AT_ONCE = 2  # least number of blocks drawn together: few large operations are faster than many


class Draws:
    """The random numbers of a step, from blocks of four words that are drawn when needed.

    The number of words taken must not depend on the data.

    Args:
        seed, episode, step: the run, episode and step of the numbers, int64, all of one shape.
        stream: the purpose of the numbers.
        dtype: the type of the numbers.
        spread: the standard deviation of the normal numbers, of the same shape; by default 1.
    """

    def __init__(
        self,
        seed: Tensor,
        episode: Tensor,
        step: Tensor,
        stream: Stream,
        dtype: torch.dtype,
        spread: Tensor | None = None,
    ) -> None:
        self._key = seed, episode
        self._block = step * BLOCKS
        self._stream, self.dtype, self._spread = stream, dtype, spread
        self._blocks, self._words = 0, list[Tensor]()

    def words(self, number: int) -> Tensor:
        """Return the next random words, int32 ``[number, …]``.

        Raises:
            ValueError: if the step has fewer words left.
        """
        if (missing := number - len(self._words)) > 0:
            blocks = max(_AT_ONCE, (missing + 3) // 4)
            if self._blocks + blocks > BLOCKS:
                raise ValueError(f"more than {4 * BLOCKS} random words in a step")
            shape = (-1, *[1] * self._block.ndim)
            numbers = torch.arange(self._blocks, self._blocks + blocks, device=self._block.device)
            seed, episode = (values.expand(blocks, *values.shape) for values in self._key)
            drawn = draw(seed, episode, self._block + numbers.view(shape), self._stream)
            self._words += [word[block] for block in range(blocks) for word in drawn]
            self._blocks += blocks
        taken, self._words = self._words[:number], self._words[number:]
        return torch.stack(taken)

    def uniform(self) -> Tensor:
        """Return the next number from U[0, 1)."""
        return uniform(self.words(1)[0], self.dtype)

    def within(self, value: float | Sequence[float]) -> Tensor:
        """Return a fixed number as a tensor, or draw from the uniform distribution over a range."""
        if not isinstance(value, float | int):
            low, high = value
            return low + (high - low) * self.uniform()
        return torch.full_like(self._key[0], value, dtype=self.dtype)

    def normals(self, number: int) -> Tensor:
        """Return numbers from N(0, spread²), ``[number, …]``, by the Box–Muller transform."""
        pairs = (number + 1) // 2
        numbers = uniform(self.words(2 * pairs), self.dtype)
        radius = torch.sqrt(-2 * torch.log(1 - numbers[:pairs]))
        angle_rad = 2 * torch.pi * numbers[pairs:]
        both = torch.cat([radius * torch.cos(angle_rad), radius * torch.sin(angle_rad)])
        return both[:number] if self._spread is None else self._spread * both[:number]

    def chances(self, number: int, probability: float) -> Tensor | None:
        """Return bools, each true with a probability, ``[number, …]``; None if that is 0."""
        if probability == 0:
            return None
        return uniform(self.words(number), self.dtype) < probability
