"""Q(s, a) as a sum of fuzzy rule bases, each over some of the inputs."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Self, cast

from torch import Tensor, nn

from fnnq_torchrl.config.values import SumConfig

from .base import ValueNetwork
from .fnnq import FNNQValue
from .labels import Labels


class FNNQSumValue(ValueNetwork):
    """Rule bases that add up: Q(s, a) = Σ_g Q_g(s_g, a), with Q_g of :class:`.FNNQValue`.

    A full rule base has a rule for each combination of all inputs' labels. Where inputs matter on
    their own, or in pairs, this has far fewer. Each group has every label of its inputs with every
    action label; all their consequents start at zero and learn together.

    Args:
        inputs: for each observation, by its name in the TensorDict, its labels (centre, width).
        action: the action's labels (centre, width).
        rules: the groups, each some names of inputs.
        candidates: the actions among which the best is sought, ``[candidates]``.
        width: whether a label's second number is a ``"sigma"`` or a ``"variance"``.
        runs: how many learners this batch holds.

    Raises:
        ValueError: if ``width`` is neither.
    """

    schema = SumConfig

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        rules: Sequence[Sequence[str]],
        candidates: Tensor,
        *,
        width: str = "sigma",
        runs: int = 1,
    ) -> None:
        super().__init__(list(inputs), candidates)
        self.parts = nn.ModuleList(
            FNNQValue(
                {name: inputs[name] for name in names},
                action,
                candidates.clone(),  # of its own each: a compiled loop allows no aliases
                width=width,
                runs=runs,
            )
            for names in rules
        )

    @classmethod
    def from_config(cls, config: SumConfig, candidates: Tensor, runs: int) -> Self:
        rules = config.groups
        return cls(config.inputs, config.action, rules, candidates, width=config.width, runs=runs)

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
