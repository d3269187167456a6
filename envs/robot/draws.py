"""Random numbers of a run, one after the other."""

from collections.abc import Sequence

import torch
from torch import Tensor

from envs.core.streams import Stream, draw, uniform

BLOCKS = 64
"""Blocks of four random words that a step has of each of these streams."""


_AT_ONCE = 2  # blocks at least, since few large operations take less time than many small ones


class Draws:
    """The random numbers of a step, from blocks of four words that are drawn as they are needed.

    How many are taken must not depend on the data.

    Args:
        seed, episode, step: whose and when, int64, any one shape.
        stream: what they are for.
        dtype: of the numbers.
    """

    def __init__(
        self, seed: Tensor, episode: Tensor, step: Tensor, stream: Stream, dtype: torch.dtype
    ) -> None:
        self._key = seed, episode
        self._block = step * BLOCKS
        self._stream, self.dtype = stream, dtype
        self._blocks, self._words = 0, list[Tensor]()

    def words(self, number: int) -> Tensor:
        """The next words, int32 ``[number, …]``.

        Raises:
            ValueError: the step has no more.
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
        """The next of U[0, 1)."""
        return uniform(self.words(1)[0], self.dtype)

    def within(self, value: float | Sequence[float]) -> Tensor:
        """A number, or one drawn from its range, each as likely."""
        if not isinstance(value, float | int):
            low, high = value
            return low + (high - low) * self.uniform()
        return torch.full_like(self._key[0], value, dtype=self.dtype)

    def normals(self, number: int) -> Tensor:
        """So many numbers of N(0, 1), ``[number, …]``, by Box and Muller's transform."""
        pairs = (number + 1) // 2
        numbers = uniform(self.words(2 * pairs), self.dtype)
        radius = torch.sqrt(-2 * torch.log(1 - numbers[:pairs]))
        angle_rad = 2 * torch.pi * numbers[pairs:]
        both = torch.cat([radius * torch.cos(angle_rad), radius * torch.sin(angle_rad)])
        return both[:number]

    def chances(self, number: int, probability: float) -> Tensor | None:
        """So many coins that fall true with a probability, ``[number, …]``; None if none can."""
        if probability == 0:
            return None
        return uniform(self.words(number), self.dtype) < probability
