"""Value networks: Q(s, a) for batches of runs, each with weights of its own."""

from torch import Tensor

from envs.core.parameters import ConfigError
from envs.core.registry import class_of
from fnnq_torchrl.config.values import CLUSTERED, ValueConfig

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
        config: of one of `NETWORKS`, or of a user's own, whose kind is ``module:Class``.
        candidates: the actions among which the best is sought, ``[candidates]``; the network has
            their dtype and device.
        runs: how many learners it holds.

    Raises:
        ConfigError: the class of a user's own isn't a :class:`ValueNetwork`, or the labels are yet
            to be found in visited states.
    """
    if getattr(config, "membership", None) == CLUSTERED:
        raise ConfigError(
            f"value.membership={CLUSTERED}: a job finds its labels when it begins to train"
        )
    network = class_of("value", config.kind, NETWORKS, ValueNetwork)
    return network.from_config(config, candidates, runs)
