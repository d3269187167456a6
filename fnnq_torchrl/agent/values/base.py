"""The base class of value networks."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, Self

from tensordict import TensorDictBase
from torch import Tensor, nn
from torch.func import functional_call

from fnnq_torchrl.config.values import ValueConfig
from fnnq_torchrl.equations.layout import per_run

Choose = Callable[[Tensor, Tensor], Tensor]
"""A policy's choice, from values ``[candidates, ...]`` and U[0, 1) ``[...]`` to actions ``[...]``.

Here ``...`` is ``runs, *batch``, after ``rules`` if each rule chooses.
"""


class ValueNetwork(nn.Module, ABC):
    """Q(s, a) for a batch of runs: every parameter has the runs as its first dimension.

    Args:
        in_keys: the keys of the observations that the network takes.
        candidates: the candidate actions, ``[candidates]``.
    """

    schema: ClassVar[type[ValueConfig]]
    """The schema of the network's configuration."""

    statistics: tuple[str, ...] = ()
    """The names of the buffers that hold running statistics of the observations, ``[runs, …]``.

    They don't learn, but :meth:`observed` updates them at every step of learning. :meth:`start`
    returns them together with the weights, so that they are saved with the weights.
    """

    choice_key: ClassVar[str] = "action"
    """The key of what a policy chooses, which :meth:`forward` takes as its action."""

    chance_keys: ClassVar[tuple[str, ...]] = ("chance",)
    """The keys of the entries that the random numbers of a choice come from."""

    candidates: Tensor

    def __init__(self, in_keys: list[str], candidates: Tensor) -> None:
        super().__init__()
        self.in_keys = in_keys
        self.register_buffer("candidates", candidates)

    @classmethod
    def from_config(cls, config: Any, candidates: Tensor, runs: int) -> Self:
        """Make the network that a configuration describes.

        Args:
            config: an instance of ``schema``.
            candidates: the candidate actions, ``[candidates]``; the network gets their dtype and
                device.
            runs: the number of runs in the batch.

        Raises:
            NotImplementedError: if a subclass doesn't override this method.
        """
        raise NotImplementedError(f"{cls.__name__} has no from_config to read a configuration")

    def start(self, seed: Tensor) -> dict[str, Tensor]:
        """Return the runs' weights before learning, by default the network's parameters.

        Args:
            seed: the runs' seeds, int64 ``[runs, 1]``, for random weights.

        Returns:
            The weights by parameter name, each ``[runs, *weights]``. If the network holds a single
            run, its parameters are repeated for every run. A network with ``statistics`` also
            returns those before the first observation.
        """
        return {
            name: weight.detach().expand(len(seed), *weight.shape[1:])
            for name, weight in self.named_parameters()
        }

    def observed(self, state: TensorDictBase) -> dict[str, Tensor]:
        """Return the statistics after the observations in a TensorDict, by their names.

        Args:
            state: the observations. If it has the statistics, too, these are the ones to update;
                otherwise the network's own are.
        """
        return {}

    @abstractmethod
    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        """Return Q(s, a) of the given action, or of every candidate action.

        Args:
            *observations: the observations in the order of ``in_keys``, each ``[runs, *batch, 1]``.
            action: ``[runs, *batch, 1]``; by default all candidates.

        Returns:
            ``[runs, *batch, 1]`` or ``[runs, *batch, candidates]``.
        """

    def decide(self, state: TensorDictBase, choose: Choose) -> dict[str, Tensor]:
        """Let a policy choose in a state, and return the entries that it writes.

        Args:
            state: a TensorDict ``[runs, *batch]`` with the observations and ``chance_keys``.
            choose: the policy's choice.

        Returns:
            ``action_value``, the result of :meth:`forward` for all candidates; ``action``,
            ``[runs, *batch, 1]``; and what was chosen, under ``choice_key``.
        """
        values = self.values_in(state)
        action = choose(values.movedim(-1, 0), per_run(state["chance"]))
        return {"action_value": values, "action": action.unsqueeze(-1)}

    def best(self, action_values: Tensor) -> Tensor:
        """Return V(s) = max Q(s, ·), ``[runs, *batch, 1]``.

        Args:
            action_values: the result of :meth:`forward` for all candidates.
        """
        return action_values.amax(-1, keepdim=True)

    def greedy(self, *observations: Tensor) -> Tensor:
        """Return the action with the highest value, or the first of equally good ones.

        Args:
            *observations: as in :meth:`forward`.

        Returns:
            ``[runs, *batch, 1]``.
        """
        return self.candidates[self(*observations).argmax(-1, keepdim=True)]

    def values_in(self, state: TensorDictBase, action: Tensor | None = None) -> Tensor:
        """Return Q for the observations in a TensorDict; otherwise as :meth:`forward`.

        If the TensorDict has the network's ``statistics``, they take the place of its own.

        Raises:
            ValueError: if the TensorDict has no batch dimension for the runs.
        """
        if state.ndim == 0:
            raise ValueError(
                "a value network needs a batch of runs: batch_size=[1] for a single run"
            )
        given = tuple(state[key] for key in self.in_keys)
        own = {name: state[name] for name in self.statistics if name in state}
        values: Tensor = (
            functional_call(self, own, given, {"action": action})
            if own
            else self(*given, action=action)
        )
        return values
