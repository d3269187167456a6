"""Value networks: Q(s, a) for batches of runs, each with its own weights."""

from torch import Tensor

from envs.core.registry import class_of
from fnnq_torchrl.config.values import ValueConfig

from .base import ValueNetwork
from .fnnq import FNNQValue
from .mlp import MLPValue
from .rbf import RBFValue
from .table import TableValue
from .tiles import TilesValue

__all__ = [
    "NETWORKS",
    "FNNQValue",
    "MLPValue",
    "RBFValue",
    "TableValue",
    "TilesValue",
    "ValueNetwork",
    "make_value_network",
]

NETWORKS: dict[str, type[ValueNetwork]] = {
    "fnnq": FNNQValue,
    "mlp": MLPValue,
    "rbf": RBFValue,
    "table": TableValue,
    "tiles": TilesValue,
}
"""The networks by their names in ``conf/value/``."""


def make_value_network(config: ValueConfig, candidates: Tensor, runs: int) -> ValueNetwork:
    """Make the value network that a configuration describes, for a batch of runs.

    Args:
        config: of one of `NETWORKS`, or of a user's own network, whose kind is ``module:Class``.
        candidates: the actions among which the best is sought, ``[candidates]``; the network has
            their dtype and device.
        runs: the number of learners it holds.

    Raises:
        ConfigError: the user's own class isn't a :class:`ValueNetwork`.
    """
    network = class_of("value", config.kind, NETWORKS, ValueNetwork)
    return network.from_config(config, candidates, runs)
