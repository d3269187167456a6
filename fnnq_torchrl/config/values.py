"""The schemas of ``conf/value/``: the keys of every value function, without torch.

``fnnq_torchrl.agent.values`` has the networks. A user's own value function, whose kind is
``module:Class``, has its schema in its class.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, ClassVar, Self

from envs.core.parameters import (
    OutOfRange,
    Parameters,
    flag,
    groups,
    matching,
    number,
    one_of,
    or_null,
    pairs,
    rising_pair,
    texts,
    whole,
    wholes,
    words,
)
from envs.core.registry import KIND
from envs.core.world import WorldConfig

__all__ = [
    "ACTIVATIONS",
    "SCHEMAS",
    "LabelsConfig",
    "MLPConfig",
    "SumConfig",
    "TilesConfig",
    "ValueConfig",
]

ACTIVATIONS = ("tanh", "relu", "leaky_relu")
"""The activation functions of an MLP's hidden units."""


@dataclass
class ValueConfig(Parameters):
    """The base class of the value functions' schemas, with checks of ``inputs``."""

    kind: str = matching(*KIND)

    of_each_input: ClassVar[str] = "an entry"
    """The noun with which messages name an entry of ``inputs``."""

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy with the world's values for the keys that are null."""
        return self

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield an error if there are no inputs, and for each input that the world doesn't have."""
        inputs, names = getattr(self, "inputs", None), ", ".join(world.observations)
        if inputs is not None and not inputs:
            yield OutOfRange("inputs", inputs, f"{self.of_each_input} for at least one of: {names}")
        for name in inputs or ():
            if name not in world.observations and isinstance(inputs, dict):
                given = inputs[name]
                yield OutOfRange(f"inputs.{name}", given, f"named after an observation: {names}")
            elif name not in world.observations:
                yield OutOfRange("inputs", inputs, f"a list of at least one of: {names}")


@dataclass
class LabelsConfig(ValueConfig):
    """The Gaussian labels [centre, width] of every input and of the action."""

    inputs: dict[str, list[Any]] = pairs("centre", "width", above=0)
    action: list[Any] = pairs("centre", "width", above=0)
    width: str = one_of("sigma", "variance")
    names: dict[str, list[str]] = words(default_factory=dict, kw_only=True)  # older jobs have none

    of_each_input: ClassVar = "labels"

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield unknown inputs, and names of labels of what is neither input nor action."""
        yield from super().misfits(world)
        known = (*world.observations, world.action_name)
        for name in self.names:
            if name not in known:
                words = f"under the name of one of: {', '.join(known)}"
                yield OutOfRange(f"names.{name}", self.names[name], words)

    def names_of(self, variable: str, count: int) -> list[str]:
        """Return the words for a variable's labels; numbers where there aren't as many words."""
        names = self.names.get(variable, [])
        if len(names) == count:
            return [*names]
        return [f"label_{number}" for number in range(1, count + 1)]


@dataclass
class SumConfig(LabelsConfig):
    """The same labels, with rules for each of some groups of inputs instead of for all at once."""

    rules: Any = or_null(groups())

    @property
    def groups(self) -> list[list[str]]:
        """The groups of inputs."""
        return self.rules or [[name] for name in self.inputs]

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield unknown inputs, groups of what isn't an input, and inputs without a rule."""
        yield from super().misfits(world)
        known = ", ".join(self.inputs)
        named = {name for group in self.groups for name in group}
        if named - {*self.inputs}:
            yield OutOfRange("rules", self.rules, f"groups of the inputs: {known}")
        if missing := [name for name in self.inputs if name not in named]:
            yield OutOfRange("rules", self.rules, f"groups with every input, {missing[0]} too")


@dataclass
class TilesConfig(ValueConfig):
    """The grids of tiles over the ranges [low, high] of every input and of the action."""

    inputs: Any = or_null(rising_pair("low", "high"))
    action: Any = or_null(rising_pair("low", "high"))
    tilings: int = whole(1)
    tiles: int = whole(1)

    of_each_input: ClassVar = "a range"

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy with the world's ranges for the keys that are null."""
        spans = {name: [*span] for name, span in world.observations.items()}
        actions = world.actions
        last = [0.0, actions - 1.0] if isinstance(actions, int) else [*actions]
        return replace(self, inputs=self.inputs or spans, action=self.action or last)

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield an error for each unknown input and for each infinite range."""
        yield from super().misfits(world)
        for name, span in (self.inputs or {}).items():
            if not all(map(isfinite, span)):
                yield OutOfRange(f"inputs.{name}", span, "a pair [low, high] of finite numbers")


@dataclass
class MLPConfig(ValueConfig):
    """The multilayer perceptron from the inputs and the action to Q."""

    inputs: Any = or_null(texts(most=64))
    widths: list[int] = wholes(1)
    activation: str = one_of(*ACTIVATIONS)
    layer_norm: bool = flag()
    sparsity: float = number(0, 1)

    of_each_input: ClassVar = "the names"

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy whose inputs, if null, are all observations of the world."""
        return self if self.inputs is not None else replace(self, inputs=[*world.observations])


SCHEMAS: dict[str, type[ValueConfig]] = {
    "fnnq": LabelsConfig,
    "fnnq_sum": SumConfig,
    "mlp": MLPConfig,
    "rbf": LabelsConfig,
    "table": LabelsConfig,
    "tiles": TilesConfig,
}
"""The schemas of the value functions by kind."""
