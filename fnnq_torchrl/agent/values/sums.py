"""Q(s, a) as a sum of value networks, each over some of the inputs."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Self, cast

from torch import Tensor, nn

from fnnq_torchrl.config.values import SumConfig, TilesSumConfig

from .base import ValueNetwork
from .fnnq import FNNQValue
from .labels import Labels
from .tiles import Span, TilesValue


class SumValue(ValueNetwork):
    """The base class of sums: Q(s, a) = Σ_g Q_g(s_g, a), with a network Q_g for each group.

    All networks start as they would alone and are learned together.

    Args:
        in_keys: the keys of the observations of all groups.
        candidates: the candidate actions, ``[candidates]``.
        parts: the networks, each over the observations of a group.
    """

    def __init__(
        self, in_keys: Sequence[str], candidates: Tensor, parts: Iterable[ValueNetwork]
    ) -> None:
        super().__init__(list(in_keys), candidates)
        self.parts = nn.ModuleList(parts)

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        named = dict(zip(self.in_keys, observations, strict=True))
        first, *others = (
            part(*(named[name] for name in part.in_keys), action=action)
            for part in cast(Iterable[ValueNetwork], self.parts)
        )
        total: Tensor = first
        for values in others:
            total = total + values
        return total


class FNNQSumValue(SumValue):
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
        parts = _parts(FNNQValue, inputs, action, rules, candidates, runs=runs, **others)
        super().__init__([*inputs], candidates, parts)

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


class TilesSumValue(SumValue):
    """A sum of tile codings, each over a group of inputs (:class:`.TilesValue`).

    Tiles over all n inputs are (tiles + 1)ⁿ in each grid. Tiles over pairs of inputs are far fewer,
    and learn from more visits.

    Args:
        inputs, action, candidates: as in :class:`.TilesValue`.
        groups: the groups, each a list of input names.
        runs: the number of runs in the batch.
        **others: the other arguments of ``TilesValue``.
    """

    schema = TilesSumConfig

    def __init__(
        self,
        inputs: Mapping[str, Span],
        action: Span | None,
        groups: Sequence[Sequence[str]],
        candidates: Tensor,
        *,
        runs: int = 1,
        **others: Any,
    ) -> None:
        parts = _parts(TilesValue, inputs, action, groups, candidates, runs=runs, **others)
        super().__init__([*inputs], candidates, parts)

    @classmethod
    def from_config(cls, config: TilesSumConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            config.action,
            config.all_groups,
            candidates,
            runs=runs,
            tilings=config.tilings,
            tiles=config.tiles,
            memory=config.memory,
        )

    def shared(self) -> tuple[int, int, int]:
        """Return the sums of what :meth:`.TilesValue.shared` returns of each group."""
        counts = [part.shared() for part in cast(Iterable[TilesValue], self.parts)]
        tiles, weights, pairs = (sum(each) for each in zip(*counts, strict=True))
        return tiles, weights, pairs


def _parts(
    make: Callable[..., ValueNetwork],
    inputs: Mapping[str, Any],
    action: Any,
    groups: Sequence[Sequence[str]],
    candidates: Tensor,
    **others: Any,
) -> Iterator[ValueNetwork]:
    """Yield a network for each group of inputs, made from the inputs of the group."""
    for names in groups:
        of_group = {name: inputs[name] for name in names}
        # Each part has its own candidates, because a compiled loop allows no aliases.
        yield make(of_group, action, candidates.clone(), **others)
