"""The schemas of ``conf/value/``: the keys of every value function. This module needs no torch.

The networks are in ``fnnq_torchrl.agent.values``. A user's own value function has the kind
``module:Class``, and its class provides the schema.
"""

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf, isfinite, sqrt
from typing import Any, ClassVar, Self

from envs.core.parameters import (
    OutOfRange,
    Parameters,
    Range,
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
from fnnq_torchrl.config.choices import shipped_labels
from fnnq_torchrl.equations.membership_functions import (
    ELSEWHERE,
    MEMBERSHIP_FUNCTIONS,
    T_NORMS,
    Membership,
    even_labels,
    membership_of,
)

__all__ = [
    "ACTIVATIONS",
    "CLUSTERED",
    "OUTPUTS",
    "SCHEMAS",
    "FuzzyConfig",
    "FuzzyQConfig",
    "LabelsConfig",
    "MLPConfig",
    "SumConfig",
    "TilesConfig",
    "TilesSumConfig",
    "ValueConfig",
]

OUTPUTS = ("one", "each")
"""The outputs of an MLP: Q of an action among the inputs, or Q of each candidate action."""

ACTIVATIONS = ("tanh", "relu", "leaky_relu")
"""The activation functions of an MLP's hidden units."""

EVEN, CLUSTERED = "even", "clustered"
"""The ways to generate labels: evenly spaced, or by clustering visited states."""

CLUSTERINGS = ("kmeans", "mixture")
"""The clustering methods: k-means, and a mixture of Gaussians."""


@dataclass
class ValueConfig(Parameters):
    """The base class of the value functions' schemas, with checks of ``inputs``."""

    kind: str = matching(*KIND)

    of_each_input: ClassVar[str] = "an entry"
    """The noun for an entry of ``inputs`` in messages."""

    linear: ClassVar[bool] = True
    """Whether Q can be linear in its weights, as step sizes for each weight need it."""

    @property
    def is_linear(self) -> bool:
        """True if Q is linear in its weights with these settings."""
        return self.linear

    rules_choose: ClassVar[bool] = False
    """Whether each rule chooses an action, so that the executed action lies between them."""

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy in which keys that are null have the world's values."""
        return self

    def overflows(self, world: WorldConfig, largest: float) -> Iterator[OutOfRange]:
        """Yield an error for each number with which a formula exceeds ``largest`` in the world."""
        yield from ()

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield an error for empty inputs and for each input that the world doesn't have."""
        inputs, names = getattr(self, "inputs", None), ", ".join(world.observations)
        if inputs is not None and not inputs:
            yield OutOfRange("inputs", inputs, f"{self.of_each_input} for at least one of: {names}")
        for name in inputs or ():
            if name not in world.observations and isinstance(inputs, dict):
                given = inputs[name]
                yield OutOfRange(f"inputs.{name}", given, f"named after an observation: {names}")
            elif name not in world.observations:
                yield OutOfRange("inputs", inputs, f"a list of at least one of: {names}")


def _is_named(label: Any) -> bool:
    """Return whether a label is a mapping {kind: [numbers]} with a single key."""
    return (
        isinstance(label, dict)
        and len(label) == 1
        and all(isinstance(kind, str) for kind in label)
        and all(isinstance(numbers, list) for numbers in label.values())
        and all(type(number) in (int, float) for numbers in label.values() for number in numbers)
    )


def _a_directory() -> Any:
    """Declare a field for the path of a directory."""
    return matching(r".{0,254}\S", "a directory, of at most 255 letters")


def _labels() -> Any:
    """Declare a field for labels of the inputs or of the action."""
    other = Range(_is_named, "{triangle: [a, b, c]} and the like")
    return or_null(pairs("centre", "width", above=0, other=other))


@dataclass
class LabelsConfig(ValueConfig):
    """The labels of every input and of the action; every combination of labels is a rule.

    A label is ``[centre, width]`` of a Gaussian or ``{kind: [parameters]}``. Fields with a default
    may be missing in the configurations of older jobs.
    """

    inputs: Any = _labels()
    action: Any = _labels()
    width: str = one_of("sigma", "variance")
    names: dict[str, list[str]] = words(default_factory=dict)
    elsewhere: str = one_of(*ELSEWHERE, default="nearest")
    membership: str = one_of("paper", EVEN, CLUSTERED, default="paper")
    labels_of_input: int = whole(1, default=5)
    labels_of_action: Any = or_null(whole(1), default=None)
    clustering: str = one_of(*CLUSTERINGS, default="kmeans")
    visited: Any = or_null(_a_directory(), default=None)
    warm_up: int = whole(1, default=100)

    of_each_input: ClassVar = "labels"

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy with evenly spaced labels if ``membership`` is ``even``."""
        names = world.observations if self.inputs is None else self.inputs
        spans = {name: world.usual.get(name, (-inf, inf)) for name in names}
        finite = all(isfinite(end) for span in spans.values() for end in span)
        if self.membership != EVEN or not finite:
            return self
        inputs = {name: self._even(*span, self.labels_of_input) for name, span in spans.items()}
        return replace(self, inputs=inputs, action=self.action_in(world))

    def found(
        self,
        inputs: Mapping[str, Sequence[Membership]],
        world: WorldConfig,
        action: Sequence[Membership] | None = None,
        names: Mapping[str, list[str]] | None = None,
    ) -> Self:
        """Return a copy that contains found labels as if a user had given them.

        Args:
            inputs: the labels of each input, by its name.
            world: the world, for the action's range.
            action: the labels of the action; those of :meth:`action_in`, if not given.
            names: the names of the labels, by the input or action.
        """
        return replace(
            self,
            inputs={name: [*map(self._written, each)] for name, each in inputs.items()},
            action=self.action_in(world) if action is None else [*map(self._written, action)],
            names={**self.names, **(names or {})},
            membership="paper",
        )

    @property
    def as_shipped(self) -> bool:
        """True if no user has set labels: they are missing, or those of a file in ``conf/``."""
        if self.inputs is None and self.action is None and self.membership == "paper":
            return True
        own = {"inputs": self.inputs, "action": self.action, "names": self.names}
        return own in shipped_labels()

    def action_in(self, world: WorldConfig) -> list[Any]:
        """Return the given labels of the action, or evenly spaced labels.

        The labels are evenly spaced if ``labels_of_action`` is set or no labels are given.
        """
        if self.labels_of_action is None and self.action is not None:
            return [*self.action]
        low, high = (0, world.actions - 1) if isinstance(world.actions, int) else world.actions
        return self._even(low, high, self.labels_of_action or self.labels_of_input)

    def _even(self, low: float, high: float, count: int) -> list[Any]:
        return [self._written(label) for label in even_labels(low, high, count)]

    def _written(self, label: Membership) -> Any:
        """Return a label as configurations have it: ``[centre, width]`` or ``{kind: …}``."""
        kind, parameters = label
        if kind != "gaussian":
            return {kind: [*parameters]}
        centre, sigma = parameters
        return [centre, sigma**2 if self.width == "variance" else sigma]

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield errors for unknown inputs or variables and for wrong or missing labels."""
        yield from super().misfits(world)
        for name, labels in (self.inputs or {}).items():
            yield from _misfits_of(f"inputs.{name}", labels)
        yield from _misfits_of("action", self.action or [])
        for key in ("inputs", "action"):
            if getattr(self, key) is None and self.membership == "paper":
                needs = "labels, or null if value.membership is even or clustered"
                yield OutOfRange(key, None, needs)
        for name in world.observations if self.inputs is None else self.inputs:
            span = world.usual.get(name, (0.0, 0.0))
            if self.membership == EVEN and not all(map(isfinite, span)):
                words = f"paper or clustered, since the range of {name} is infinite"
                yield OutOfRange("membership", EVEN, words)
        known = (*world.observations, world.action_name)
        for name in self.names:
            if name not in known:
                words = f"named after one of: {', '.join(known)}"
                yield OutOfRange(f"names.{name}", self.names[name], words)

    def overflows(self, world: WorldConfig, largest: float) -> Iterator[OutOfRange]:
        """Yield an error for each label that is so narrow that its log μ overflows."""
        low, high = (0, world.actions - 1) if isinstance(world.actions, int) else world.actions
        variables = {
            f"inputs.{name}": (labels, world.observations[name])
            for name, labels in (self.inputs or {}).items()
        } | {"action": (self.action or [], (low, high))}
        for key, (labels, span) in variables.items():
            functions = [membership_of(label, self.width) for label in labels]
            middles = [MEMBERSHIP_FUNCTIONS[kind].middle(numbers) for kind, numbers in functions]
            ends = [end for end in (*middles, *span) if isfinite(end)]
            reach = max(ends) - min(ends)
            for label, (kind, numbers) in zip(labels, functions, strict=True):
                least = reach / sqrt(largest)
                width = MEMBERSHIP_FUNCTIONS[kind].narrowest(numbers)
                if width < least:
                    units = least**2 if isinstance(label, list) and self.width != "sigma" else least
                    yield OutOfRange(key, label, f"a label with a width above {units:.1e}")

    def names_of(self, variable: str, count: int) -> list[str]:
        """Return a variable's label names; label_1, label_2, … if their number doesn't fit."""
        names = self.names.get(variable, [])
        if len(names) == count:
            return [*names]
        return [f"label_{number}" for number in range(1, count + 1)]


def _misfits_of(key: str, labels: Sequence[Any]) -> Iterator[OutOfRange]:
    """Yield an error for each label of an unknown kind or with wrong parameters."""
    for label in labels:
        if isinstance(label, dict):
            ((kind, numbers),) = label.items()
            if kind not in MEMBERSHIP_FUNCTIONS:
                near = difflib.get_close_matches(kind, MEMBERSHIP_FUNCTIONS, n=1)
                advice = f"; did you mean {near[0]}?" if near else ""
                yield OutOfRange(key, label, f"of a kind {_one_of(MEMBERSHIP_FUNCTIONS)}{advice}")
            elif misfit := MEMBERSHIP_FUNCTIONS[kind].misfit(numbers):
                yield OutOfRange(key, label, f"{kind}: {misfit}")


def _one_of(names: Iterable[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} or {last}"


@dataclass
class FuzzyConfig(LabelsConfig):
    """A fuzzy rule base, whose labels may be learned together with the consequents."""

    t_norm: str = one_of(*T_NORMS, default="product")
    learn_memberships: bool = flag(default=False)
    least_width: float = number(above=0, high=1, default=0.1)

    @property
    def is_linear(self) -> bool:
        return not self.learn_memberships

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield the errors of `LabelsConfig`, and one if labels to be learned aren't Gaussian."""
        yield from super().misfits(world)
        every = [*(self.inputs or {}).values(), self.action or []]
        if self.learn_memberships and any(isinstance(label, dict) for of in every for label in of):
            yield OutOfRange(
                "learn_memberships", True, "false, unless all labels are Gaussian [centre, width]"
            )


@dataclass
class FuzzyQConfig(LabelsConfig):
    """The action values of fuzzy Q-learning: each rule chooses a label of the action."""

    rules_choose: ClassVar = True

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield the errors of `LabelsConfig`, and errors for what the rules can't choose among."""
        wrong = [*super().misfits(world)]
        yield from wrong
        if self.elsewhere != "nearest":
            yield OutOfRange("elsewhere", self.elsewhere, "nearest, since a rule must choose")
        if wrong or self.action is None:
            return
        functions = [membership_of(label, self.width) for label in self.action]
        middles = [MEMBERSHIP_FUNCTIONS[kind].middle(numbers) for kind, numbers in functions]
        low, high = (0, world.actions - 1) if isinstance(world.actions, int) else world.actions
        if len({min(max(middle, low), high) for middle in middles}) < len(middles):
            yield OutOfRange("action", self.action, "labels with different middles in the range")


@dataclass
class SumConfig(LabelsConfig):
    """A sum of fuzzy rule bases, one for each group of inputs."""

    rules: Any = or_null(groups(), kw_only=True)

    @property
    def groups(self) -> list[list[str]]:
        """The groups of inputs; by default, each input is a group."""
        return self.rules or [[name] for name in self.inputs or {}]

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield the errors of `LabelsConfig`, and errors for unknown or missing group inputs."""
        yield from super().misfits(world)
        yield from _misfits_of_groups("rules", self.rules, self.groups, self.inputs or {})


def _misfits_of_groups(
    key: str, given: Any, groups_: Sequence[Sequence[str]], inputs: Iterable[str]
) -> Iterator[OutOfRange]:
    """Yield an error for an unknown input in a group, and for an input without a group."""
    inputs = [*inputs]
    named = {name for group in groups_ for name in group}
    if named - {*inputs}:
        yield OutOfRange(key, given, f"groups of the inputs: {', '.join(inputs)}")
    if missing := [name for name in inputs if name not in named]:
        yield OutOfRange(key, given, f"groups that include every input, also {missing[0]}")


@dataclass
class TilesConfig(ValueConfig):
    """Tile coding with grids over the ranges [low, high] of every input and of the action.

    In a world with a fixed set of actions, ``action`` is null, and each action has its own tiles.
    """

    inputs: Any = or_null(rising_pair("low", "high"))
    action: Any = or_null(rising_pair("low", "high"))
    tilings: int = whole(1)
    tiles: int = whole(1)
    memory: Any = or_null(whole(1), default=None)

    of_each_input: ClassVar = "a range"

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy in which ranges that are null are the world's."""
        spans = {name: [*span] for name, span in world.usual.items()}
        actions = None if isinstance(world.actions, int) else [*world.actions]
        return replace(self, inputs=self.inputs or spans, action=self.action or actions)

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield an error for each unknown input and for each infinite range."""
        yield from super().misfits(world)
        for name, span in (self.inputs or {}).items():
            if not all(map(isfinite, span)):
                yield OutOfRange(f"inputs.{name}", span, "a pair [low, high] of finite numbers")


@dataclass
class TilesSumConfig(TilesConfig):
    """A sum of tile codings, one for each group of inputs."""

    groups: Any = or_null(groups(), kw_only=True)

    @property
    def all_groups(self) -> list[list[str]]:
        """The groups of inputs; by default, every pair of inputs, or the only input."""
        names = [*(self.inputs or {})]
        return self.groups or [list(pair) for pair in combinations(names, min(2, len(names)))]

    def misfits(self, world: WorldConfig) -> Iterator[OutOfRange]:
        """Yield the errors of `TilesConfig`, and errors for unknown or missing group inputs."""
        yield from super().misfits(world)
        yield from _misfits_of_groups("groups", self.groups, self.all_groups, self.inputs or {})


@dataclass
class MLPConfig(ValueConfig):
    """A multilayer perceptron from the inputs and the action to Q.

    Fields with a default may be missing in the configurations of older jobs.
    """

    inputs: Any = or_null(texts(most=64))
    widths: list[int] = wholes(1)
    activation: str = one_of(*ACTIVATIONS)
    layer_norm: bool = flag()
    sparsity: float = number(0, 1)
    outputs: str = one_of(*OUTPUTS, default="one")
    normalise: bool = flag(default=False)

    of_each_input: ClassVar = "the names"
    linear: ClassVar = False

    def in_world(self, world: WorldConfig) -> Self:
        """Return a copy in which null inputs are replaced by all observations of the world."""
        return self if self.inputs is not None else replace(self, inputs=[*world.observations])


SCHEMAS: dict[str, type[ValueConfig]] = {
    "fnnq": FuzzyConfig,
    "fnnq_sum": SumConfig,
    "fuzzy_q": FuzzyQConfig,
    "mlp": MLPConfig,
    "rbf": LabelsConfig,
    "table": LabelsConfig,
    "tiles": TilesConfig,
    "tiles_sum": TilesSumConfig,
}
"""The schemas of the value functions by kind."""
