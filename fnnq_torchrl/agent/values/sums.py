"""Q(s, a) as a sum of fuzzy rule bases, each over some of the inputs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self, cast

from torch import Tensor, nn

from fnnq_torchrl.config.values import SumConfig

from .base import ValueNetwork
from .fnnq import FNNQValue
from .labels import Labels


class FNNQSumValue(ValueNetwork):
    """A sum of rule bases: Q(s, a) = Σ_g Q_g(s_g, a), with each Q_g an :class:`.FNNQValue`.

    A full rule base has a rule for every combination of the labels of all inputs and the action.
    Here each group g has a rule for every combination of its own inputs' and the action's labels,
    which makes far fewer rules. All consequents start at zero and are learned together.

    Args:
        inputs, action, candidates: as in :class:`.FNNQValue`.
        rules: the groups, each a list of input names.
        runs: the number of runs in the batch.
        **others: the other arguments of ``FNNQValue``, which raises the same errors.
    """

    schema = SumConfig

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        rules: Sequence[Sequence[str]],
        candidates: Tensor,
        *,
        runs: int = 1,
        **others: Any,
    ) -> None:
        super().__init__(list(inputs), candidates)
        self.parts = nn.ModuleList(
            FNNQValue(
                {name: inputs[name] for name in names},
                action,
                candidates.clone(),  # because a compiled loop allows no aliases
                runs=runs,
                **others,
            )
            for names in rules
        )

    @classmethod
    def from_config(cls, config: SumConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            config.action,
            config.groups,
            candidates,
            runs=runs,
            width=config.width,
            elsewhere=config.elsewhere,
        )

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        named = dict(zip(self.in_keys, observations, strict=True))
        first, *others = (
            part(*(named[name] for name in part.in_keys), action=action)
            for part in cast(Iterable[FNNQValue], self.parts)
        )
        total: Tensor = first
        for values in others:
            total = total + values
        return total
