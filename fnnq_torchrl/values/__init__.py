"""Value networks: Q(s, a) for batches of runs, each with weights of its own."""

from torch import Tensor

from fnnq_torchrl.value_config import ValueConfig

from .base import ValueNetwork
from .fnnq import FNNQValue
from .mlp import MLPValue
from .rbf import RBFValue
from .table import TableValue
from .tiles import TilesValue

__all__ = [
    "FNNQValue",
    "MLPValue",
    "RBFValue",
    "TableValue",
    "TilesValue",
    "ValueNetwork",
    "make_value_network",
]

_NETWORKS: dict[str, type[ValueNetwork]] = {
    "fnnq": FNNQValue,
    "mlp": MLPValue,
    "rbf": RBFValue,
    "table": TableValue,
    "tiles": TilesValue,
}


def make_value_network(config: ValueConfig, candidates: Tensor, runs: int) -> ValueNetwork:
    """The value network that a configuration describes, for a batch of runs.

    It has the dtype and the device of the candidate actions, ``[candidates]``.
    """
    return _NETWORKS[config.kind].from_config(config, candidates, runs)
