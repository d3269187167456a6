"""Value networks: Q(s, a) for batches of runs, each with weights of its own."""

from importlib import import_module

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
    "network_of",
]


def network_of(kind: str) -> type[ValueNetwork]:
    """The network that ``values/<kind>.py`` defines.

    Args:
        kind: one of `fnnq_torchrl.value_config.KINDS`.

    Raises:
        ImportError: there is no such file.
    """
    module = import_module(f"{__name__}.{kind}")
    [network] = [
        each
        for each in vars(module).values()
        if isinstance(each, type)
        and issubclass(each, ValueNetwork)
        and each.__module__ == module.__name__
    ]
    return network


def make_value_network(config: ValueConfig, candidates: Tensor, runs: int) -> ValueNetwork:
    """The value network that a configuration describes, for a batch of runs.

    It has the dtype and the device of the candidate actions, ``[candidates]``.
    """
    return network_of(config.kind).from_config(config, candidates, runs)
