"""Q(s, a) by tile coding."""

from collections.abc import Mapping, Sequence
from typing import Self

import torch
from torch import Tensor, nn

from fnnq_torchrl.config.values import TilesConfig
from fnnq_torchrl.equations.layout import runs_first, runs_last

from .base import ValueNetwork

Span = Sequence[float]


class TilesValue(ValueNetwork):
    """Tile coding: Q(s, a) is the sum of one weight of every tiling, that of the tile at (s, a).

    A tiling is a grid over all inputs and the action. If the actions are a fixed set, each action
    has its own tiles instead. Tiling t is offset by t·(1, 3, 5, …)/tilings of a tile along input 1,
    2, 3, …, modulo a tile. To cover the range despite its offset, a grid has one extra tile along
    each dimension. A number beyond the range falls into the edge's tile.

    Every run has its own weights, all zero at the start: ``weight`` is ``[runs, tiles of input 1,
    …, action tiles, tilings]``, with the runs last in memory.

    Source: R. S. Sutton, A. G. Barto, "Reinforcement learning", 2nd edition, 2018, section 9.5.4;
    the offsets are those of W. T. Miller and F. H. Glanz, 1996.

    Args:
        inputs: the range (low, high) of each observation, by its key in the TensorDict.
        action: the range (low, high) of the action; None gives each candidate its own tiles.
        candidates: the candidate actions, ``[candidates]``, in the network's dtype and device.
        tilings: the number of grids.
        tiles: the number of tiles that fit into each range.
        runs: the number of runs in the batch; a network of one run takes inputs of any batch size.
    """

    schema = TilesConfig

    candidate_tiles: Tensor

    def __init__(
        self,
        inputs: Mapping[str, Span],
        action: Span | None,
        candidates: Tensor,
        *,
        tilings: int,
        tiles: int,
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
        weights = candidates.new_zeros([*[tiles + 1] * len(inputs), actions, tilings, runs])
        self.weight = nn.Parameter(runs_first(weights))

    @classmethod
    def from_config(cls, config: TilesConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            config.action,
            candidates,
            tilings=config.tilings,
            tiles=config.tiles,
            runs=runs,
        )

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        *tiles, actions, tilings, _ = runs_last(self.weight).shape
        cell = self._tile(0, runs_last(observations[0].squeeze(-1)))
        for i, x in enumerate(observations[1:], start=1):
            cell = cell * tiles[i] + self._tile(i, runs_last(x.squeeze(-1)))
        if action is None:
            action_tile = self.candidate_tiles.view(-1, *[1] * (cell.ndim - 2), tilings, 1)
        else:
            action_tile = self._action_tile(runs_last(action.squeeze(-1))).unsqueeze(0)
        # Of each tiling, only the weight of one cell is read: most of the others are far away.
        index = (cell * actions + action_tile).long()
        weights = runs_last(self.weight).flatten(0, len(tiles))
        weights = weights.view(-1, *[1] * (cell.ndim - 2), *weights.shape[1:])
        of_each_tiling = weights.expand(-1, *index.shape[1:]).gather(0, index)
        return of_each_tiling.sum(-2).movedim((0, -1), (-1, 0))

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
