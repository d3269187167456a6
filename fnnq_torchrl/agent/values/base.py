"""The interface of value networks for policy and loss."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

from tensordict import TensorDictBase
from torch import Tensor, nn

from fnnq_torchrl.config.values import ValueConfig


class ValueNetwork(nn.Module, ABC):
    """Q(s, a) for a batch of runs: every parameter has the runs as its first dimension.

    Args:
        in_keys: the observations that it takes, by their names in the TensorDict.
        candidates: the actions among which the best is sought, ``[candidates]``.
    """

    schema: ClassVar[type[ValueConfig]]
    """The schema of its configuration."""

    candidates: Tensor

    def __init__(self, in_keys: list[str], candidates: Tensor) -> None:
        super().__init__()
        self.in_keys = in_keys
        self.register_buffer("candidates", candidates)

    @classmethod
    def from_config(cls, config: Any, candidates: Tensor, runs: int) -> Self:
        """Make the network that a configuration describes.

        Args:
            config: an instance of its ``schema``.
            candidates: the actions among which the best is sought, ``[candidates]``; the network
                has their dtype and device.
            runs: the number of learners it holds.

        Raises:
            NotImplementedError: the class can't be made from a configuration.
        """
        raise NotImplementedError(f"{cls.__name__} is made in Python, not from a configuration")

    def start(self, seed: Tensor) -> dict[str, Tensor]:
        """Return the weights of runs before they learn, by default the parameters as they are.

        Args:
            seed: the runs' seeds, int64 ``[runs, 1]``, for random weights.

        Returns:
            By the parameters' names, each ``[runs, *weights]``. The parameters of a network of a
            single run are repeated for all.
        """
        return {
            name: weight.detach().expand(len(seed), *weight.shape[1:])
            for name, weight in self.named_parameters()
        }

    @abstractmethod
    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        """Return Q(s, a) of an action, or of every candidate.

        Args:
            *observations: in the order of ``in_keys``, each ``[runs, *batch, 1]``.
            action: ``[runs, *batch, 1]``; by default all candidates.

        Returns:
            ``[runs, *batch, 1]`` or ``[runs, *batch, candidates]``.
        """

    def values_in(self, state: TensorDictBase, action: Tensor | None = None) -> Tensor:
        """Return Q in a TensorDict's state; ``action`` and the result are as in :meth:`forward`.

        Raises:
            ValueError: the TensorDict has no dimension of runs.
        """
        if state.ndim == 0:
            raise ValueError(
                "a value network needs a batch of runs: batch_size=[1] for a single one"
            )
        values: Tensor = self(*(state[key] for key in self.in_keys), action=action)
        return values
