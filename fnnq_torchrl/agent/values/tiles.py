"""Q(s, a) by tile coding."""

from collections.abc import Mapping, Sequence
from math import prod
from typing import Self

import torch
from torch import Tensor, nn

from fnnq_torchrl.config.values import TilesConfig
from fnnq_torchrl.equations.layout import runs_first, runs_last

from .base import ValueNetwork

Span = Sequence[float]

_COUNTED = 2**24
"""The largest number of tiles whose shared weights are counted one by one."""


class TilesValue(ValueNetwork):
    """Tile coding: Q(s, a) is the sum of one weight of every tiling, that of the tile at (s, a).

    A tiling is a grid over all inputs and the action. If the actions are a fixed set, each action
    has its own tiles instead. Tiling t is offset by t·(1, 3, 5, …)/tilings of a tile along input 1,
    2, 3, …, modulo a tile. To cover the range despite its offset, a grid has one extra tile along
    each dimension. A number beyond the range falls into the edge's tile.

    Every run has its own weights, all zero at the start: ``weight`` is ``[runs, tiles of input 1,
    …, action tiles, tilings]``, with the runs last in memory. A tiling with more tiles than
    ``memory`` has so many weights instead, ``[runs, memory, tilings]``. Its tiles are then hashed,
    so that several share a weight (:meth:`shared`).

    Source: R. S. Sutton, A. G. Barto, "Reinforcement learning", 2nd edition, 2018, section 9.5.4;
    the offsets are those of W. T. Miller and F. H. Glanz, 1996.

    Args:
        inputs: the range (low, high) of each observation, by its key in the TensorDict.
        action: the range (low, high) of the action; None gives each candidate its own tiles.
        candidates: the candidate actions, ``[candidates]``, in the network's dtype and device.
        tilings: the number of grids.
        tiles: the number of tiles that fit into each range.
        memory: the largest number of weights of a tiling; None for a weight for each tile.
        runs: the number of runs in the batch; a network of one run takes inputs of any batch size.
    """

    schema = TilesConfig

    candidate_tiles: Tensor
    tiling: Tensor

    def __init__(
        self,
        inputs: Mapping[str, Span],
        action: Span | None,
        candidates: Tensor,
        *,
        tilings: int,
        tiles: int,
        memory: int | None = None,
        runs: int = 1,
    ) -> None:
        super().__init__(list(inputs), candidates)
        self._spans = [*inputs.values(), *([] if action is None else [action])]
        self._tiles = tiles
        for i in range(len(self._spans)):
            number = torch.arange(tilings) * (2 * i + 1) % tilings
            offset = number.float() / tilings
            self.register_buffer(f"offset_{i}", offset.to(candidates).unsqueeze(-1))
        # The candidates never change, so neither do their tiles.
        of_candidates = self._action_tile(candidates.unsqueeze(-1)).expand(-1, tilings, 1)
        self.register_buffer("candidate_tiles", of_candidates.clone(), persistent=False)
        actions = len(candidates) if action is None else tiles + 1
        self._sizes = [*[tiles + 1] * len(inputs), actions]
        self._memory = memory if memory is not None and prod(self._sizes) > memory else None
        numbers = torch.arange(tilings, dtype=torch.int32, device=candidates.device)
        self.register_buffer("tiling", numbers.unsqueeze(-1), persistent=False)
        stored = self._sizes if self._memory is None else [self._memory]
        weights = candidates.new_zeros([*stored, tilings, runs])
        self.weight = nn.Parameter(runs_first(weights))

    @classmethod
    def from_config(cls, config: TilesConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            config.action,
            candidates,
            tilings=config.tilings,
            tiles=config.tiles,
            memory=config.memory,
            runs=runs,
        )

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        (*tiles, actions), tilings = self._sizes, len(self.tiling)
        cell = self._tile(0, runs_last(observations[0].squeeze(-1)))
        for i, x in enumerate(observations[1:], start=1):
            cell = cell * tiles[i] + self._tile(i, runs_last(x.squeeze(-1)))
        if action is None:
            action_tile = self.candidate_tiles.view(-1, *[1] * (cell.ndim - 2), tilings, 1)
        else:
            action_tile = self._action_tile(runs_last(action.squeeze(-1))).unsqueeze(0)
        # Of each tiling, only the weight of one cell is read: most of the others are far away.
        index = self._place(cell * actions + action_tile).long()
        weights = runs_last(self.weight).flatten(0, -3)
        weights = weights.view(-1, *[1] * (cell.ndim - 2), *weights.shape[1:])
        of_each_tiling = weights.expand(-1, *index.shape[1:]).gather(0, index)
        return of_each_tiling.sum(-2).movedim((0, -1), (-1, 0))

    def shared(self) -> tuple[int, int, int]:
        """Return the numbers of tiles, of weights, and of pairs of tiles that share a weight.

        All numbers are of a single run. Tiles of different tilings never share a weight. Beyond
        16 million tiles, the number of pairs is the expected one.
        """
        tilings, tiles = len(self.tiling), prod(self._sizes)
        if self._memory is None:
            return tiles * tilings, tiles * tilings, 0
        weights = self._memory * tilings
        if tiles * tilings > _COUNTED:
            return tiles * tilings, weights, round(tilings * tiles * (tiles - 1) / 2 / self._memory)
        cells = torch.arange(tiles, dtype=torch.int32, device=self.tiling.device)
        counts = [torch.bincount(at, minlength=1) for at in self._place(cells.expand(tilings, -1))]
        pairs = sum(int((count * (count - 1) // 2).sum()) for count in counts)
        return tiles * tilings, weights, pairs

    def _place(self, cell: Tensor) -> Tensor:
        """Return the row of ``weight`` that holds each tile's weight.

        Args:
            cell: the number of each tile in its tiling, int32 ``[..., tilings, runs]``.

        Returns:
            int32, of the same shape.
        """
        if self._memory is None:
            return cell
        share = _scrambled(cell * len(self.tiling) + self.tiling)
        return (share.to(self.candidates.dtype) * (2.0**-24 * self._memory)).int()

    def _action_tile(self, action: Tensor) -> Tensor:
        """Return the tile of each action; arguments and shape as in :meth:`_tile`."""
        if len(self._spans) > len(self.in_keys):
            return self._tile(len(self.in_keys), action)
        own = self.candidates.view(-1, *[1] * action.ndim) == action
        numbers = torch.arange(len(own), device=action.device, dtype=torch.int32)
        return (own * numbers.view(-1, *[1] * action.ndim)).sum(0, dtype=torch.int32).unsqueeze(-2)

    def _tile(self, i: int, x: Tensor) -> Tensor:
        """Return the tile that contains each number, along one dimension of every grid.

        Args:
            i: the index of the input, or the number of inputs for the action.
            x: the numbers, ``[..., runs]``.

        Returns:
            The tile's index, int32 ``[..., tilings or 1, runs]``.
        """
        (low, high), offset = self._spans[i], getattr(self, f"offset_{i}")
        place = (x.unsqueeze(-2) - low) * (self._tiles / (high - low)) + offset
        # The upper end of the range belongs to the last tile that overlaps the range.
        last = (self._tiles + offset).ceil() - 1
        # NaN, which a world may give after it has failed, has the first tile.
        return torch.minimum(torch.where(place > 0, place, 0), last).int()


def _scrambled(number: Tensor) -> Tensor:
    """Return a hash of whole numbers, in [0, 2²⁴), which float32 holds exactly.

    Source: C. Wellons' "lowbias32", a hash of 32-bit integers by multiplications and shifts.

    Args:
        number: int32; products wrap, as the hash requires.
    """
    number = (number ^ ((number >> 16) & 0xFFFF)) * 0x7FEB352D
    number = (number ^ ((number >> 15) & 0x1FFFF)) * (0x846CA68B - 2**32)
    return ((number ^ ((number >> 16) & 0xFFFF)) >> 8) & 0xFFFFFF
