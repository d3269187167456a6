"""Records that a learner keeps of what its runs do, besides what they learn. Runs come first."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.update import Weights
from fnnq_torchrl.equations.layout import over_batch


class Record(ABC):
    """The base class of records. A record is an entry of the learner's state.

    Attributes:
        name: the name of the entry.
    """

    name: ClassVar[str]

    @abstractmethod
    def start(self, run: TensorDictBase, weights: Weights) -> Any:
        """Return the record before the first step.

        Args:
            run: the values of the runs.
            weights: the weights, by name.
        """

    @abstractmethod
    def update(self, state: Mapping[str, Any], slope: Weights, after: TensorDictBase) -> Any:
        """Return the record after a step.

        Args:
            state: the learner's state before the step, with this record.
            slope: ∇Q(s, a) of the step, by the names of the weights.
            after: the entry ``"next"`` of the step.
        """

    def told(self, record: Any) -> Mapping[str, Tensor]:
        """Return the numbers that an evaluation tells, each ``[runs, 1]``."""
        return {}

    def renewed(self, record: Any, due: Tensor) -> Any:
        """Return the record as it goes on after an evaluation, in the runs where one is ``due``."""
        return record


class Fired(Record):
    """The rules' firing strengths ∂Q(s, a)/∂w, summed over the steps learned from.

    It is for a network whose parameter ``weight`` holds the rules' consequents.
    """

    name = "fired"

    def start(self, run: TensorDictBase, weights: Weights) -> Tensor:
        return torch.zeros_like(weights["weight"])

    def update(self, state: Mapping[str, Any], slope: Weights, after: TensorDictBase) -> Tensor:
        goes_on = over_batch(state["over"].logical_not(), like=state["fired"])
        fired: Tensor = state["fired"] + goes_on * slope["weight"]
        return fired


class Earned(Record):
    """The sum of rewards (``return``) and the number of successes since the last evaluation."""

    name = "earned"

    def start(self, run: TensorDictBase, weights: Weights) -> TensorDict:
        none = {"return": torch.zeros_like(run["alpha"]), "success": torch.zeros_like(run["seed"])}
        return TensorDict(none, run.batch_size, device=run.device)

    def update(
        self, state: Mapping[str, Any], slope: Weights, after: TensorDictBase
    ) -> dict[str, Tensor]:
        new = {"return": after["reward"], "success": after["success"].to(torch.int64)}
        return {key: state["earned"][key] + new[key] for key in new}

    def told(self, record: Mapping[str, Tensor]) -> Mapping[str, Tensor]:
        return {**record}

    def renewed(self, record: Mapping[str, Tensor], due: Tensor) -> dict[str, Tensor]:
        return {key: torch.where(due, 0, sum_) for key, sum_ in record.items()}
