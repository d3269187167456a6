"""What a value network offers to policy and loss."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Self

from tensordict import TensorDictBase
from torch import Tensor, nn

from fnnq_torchrl.config.values import ValueConfig


class ValueNetwork(nn.Module, ABC):
    """Q(s, a) for a batch of runs: every parameter has the runs as its first dimension.

    Args:
        in_keys: the observations that it sees, by their names in the TensorDict.
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
        """The network that a configuration describes, for those that ``conf/value/`` has.

        Args:
            config: of its kind (its `schema`).
            candidates: the actions among which the best is sought, ``[candidates]``; their dtype
                and device are the network's.
            runs: how many learners it holds.

        Raises:
            NotImplementedError: it has no configuration.
        """
        raise NotImplementedError(f"{cls.__name__} is made in Python, not from a configuration")

    def start(self, seed: Tensor) -> dict[str, Tensor]:
        """The weights of runs before they learn; by default those that the parameters have.

        Args:
            seed: of the runs, int64 ``[runs, 1]``, for what is random.

        Returns:
            By the parameters' names, each ``[runs, *weights]``. A network of a single run serves
            for any number of them.
        """
        return {
            name: weight.detach().expand(len(seed), *weight.shape[1:])
            for name, weight in self.named_parameters()
        }

    @abstractmethod
    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        """Q(s, a) of an action, or of every candidate.

        Args:
            *observations: in the order of ``in_keys``, each ``[runs, *batch, 1]``.
            action: ``[runs, *batch, 1]``; all the candidates if not given.

        Returns:
            ``[runs, *batch, 1]`` or ``[runs, *batch, candidates]``.
        """

    def values_in(self, state: TensorDictBase, action: Tensor | None = None) -> Tensor:
        """Q in the state that a TensorDict describes; the rest as in :meth:`forward`.

        Raises:
            ValueError: the TensorDict has no dimension of runs.
        """
        if state.ndim == 0:
            raise ValueError(
                "a value network needs a batch of runs: batch_size=[1] for a single one"
            )
        values: Tensor = self(*(state[key] for key in self.in_keys), action=action)
        return values
