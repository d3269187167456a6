"""Value networks: Q(s, a) for batches of runs. Each run has its own weights."""

from torch import Tensor

from envs.core.parameters import ConfigError
from envs.core.registry import class_of
from fnnq_torchrl.config.values import CLUSTERED, ValueConfig

from .base import ValueNetwork
from .fnnq import FNNQValue
from .fuzzy_q import FuzzyQValue
from .mlp import MLPValue
from .rbf import RBFValue
from .sums import FNNQSumValue, TilesSumValue
from .table import TableValue
from .tiles import TilesValue

__all__ = [
    "NETWORKS",
    "FNNQSumValue",
    "FNNQValue",
    "FuzzyQValue",
    "MLPValue",
    "RBFValue",
    "TableValue",
    "TilesSumValue",
    "TilesValue",
    "ValueNetwork",
    "make_value_network",
]

NETWORKS: dict[str, type[ValueNetwork]] = {
    "fnnq": FNNQValue,
    "fnnq_sum": FNNQSumValue,
    "fuzzy_q": FuzzyQValue,
    "mlp": MLPValue,
    "rbf": RBFValue,
    "table": TableValue,
    "tiles": TilesValue,
    "tiles_sum": TilesSumValue,
}
"""The networks by kind."""


def make_value_network(config: ValueConfig, candidates: Tensor, runs: int) -> ValueNetwork:
    """Make the value network that a configuration describes, for a batch of runs.

    Args:
        config: the configuration of one of `NETWORKS` or of a user's network (``module:Class``).
        candidates: the candidate actions, ``[candidates]``, in the network's dtype and device.
        runs: the number of runs in the batch.

    Raises:
        ConfigError: if the user's class can't be imported or isn't a :class:`ValueNetwork`, or if
            the labels have yet to be found by clustering.
    """
    if getattr(config, "membership", None) == CLUSTERED:
        raise ConfigError(
            f"value.membership={CLUSTERED}: a job finds its labels when it begins to train"
        )
    network = class_of("value.kind", config.kind, NETWORKS, ValueNetwork)
    return network.from_config(config, candidates, runs)
