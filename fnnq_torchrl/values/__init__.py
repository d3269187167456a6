"""Value networks: Q(s, a) for batches of runs, each with weights of its own."""

from torch import Tensor

from fnnq_torchrl.config import FNNQConfig

from .base import ValueNetwork
from .fnnq import FNNQValue

__all__ = ["FNNQValue", "ValueNetwork", "make_value_network"]


def make_value_network(config: FNNQConfig, candidates: Tensor, runs: int) -> ValueNetwork:
    """The value network that a configuration describes, for a batch of runs.

    It has the dtype and the device of the candidate actions, ``[candidates]``.
    """
    return FNNQValue(config.inputs, config.action, candidates, width=config.width, runs=runs)
