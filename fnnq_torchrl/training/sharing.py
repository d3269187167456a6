"""The tiles that share their weights, in words."""

import torch

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import TilesSumValue, TilesValue, make_value_network
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.config.values import TilesConfig


def sharing_in_words(config: Config) -> str | None:
    """Return a line on hashed tiles that share weights; None if there are none."""
    if not isinstance(config.value, TilesConfig) or config.value.memory is None:
        return None
    network = make_value_network(config.value, make_candidates(config, torch.float32), 1)
    if not isinstance(network, TilesValue | TilesSumValue):
        return None
    tiles, weights, pairs = network.shared()
    if not pairs:
        return None
    return (
        f"{tiles:,} tiles share {weights:,} weights of a run (value.memory): {tiles / weights:.1f} "
        f"tiles a weight, {pairs:,} pairs of tiles with the same weight"
    )
