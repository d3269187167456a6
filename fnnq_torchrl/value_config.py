"""The schemas of ``conf/value/``: the keys of every kind of value function. No torch here.

A kind is a YAML in ``conf/value/`` and a file of the same name in ``fnnq_torchrl/values/``, whose
network says what its schema is. The schemas that stand here are known before torch is loaded.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from envs.ranges import (
    OutOfRange,
    Parameters,
    flag,
    number,
    one_of,
    pairs,
    rising_pair,
    some_of,
    whole,
    wholes,
)
from envs.world import OBSERVATIONS
from fnnq_torchrl.choices import choices_of

__all__ = [
    "ACTIVATIONS",
    "KINDS",
    "LabelsConfig",
    "MLPConfig",
    "TilesConfig",
    "ValueConfig",
    "schema_of",
]

KINDS = tuple(choices_of("value"))
"""The value functions by their names: ``conf/value/<kind>.yaml``, ``values/<kind>.py``."""

ACTIVATIONS = ("tanh", "relu", "leaky_relu")
"""What the hidden units of an MLP do."""


@dataclass
class ValueConfig(Parameters):
    """What every value function has: its kind."""

    kind: str = one_of(*KINDS)


@dataclass
class LabelsConfig(ValueConfig):
    """Gaussian labels [centre, width] of every input and of the action, each with each."""

    inputs: dict[str, list[Any]] = pairs("centre", "width", above=0)
    action: list[Any] = pairs("centre", "width", above=0)
    width: str = one_of("sigma", "variance")

    def contradictions(self) -> Iterator[OutOfRange]:
        """Inputs that the world doesn't offer, or none at all."""
        yield from _unknown(self.inputs, "labels")


@dataclass
class TilesConfig(ValueConfig):
    """Grids of tiles over the ranges [low, high] of every input and of the action."""

    inputs: dict[str, list[Any]] = rising_pair("low", "high")
    action: list[Any] = rising_pair("low", "high")
    tilings: int = whole(1)
    tiles: int = whole(1)

    def contradictions(self) -> Iterator[OutOfRange]:
        """Inputs that the world doesn't offer, or none at all."""
        yield from _unknown(self.inputs, "a range")


@dataclass
class MLPConfig(ValueConfig):
    """A multilayer perceptron of the inputs and the action."""

    inputs: list[str] = some_of(*OBSERVATIONS)
    widths: list[int] = wholes(1)
    activation: str = one_of(*ACTIVATIONS)
    layer_norm: bool = flag()
    sparsity: float = number(0, 1)


_LIGHT: dict[str, type[ValueConfig]] = {
    "fnnq": LabelsConfig,
    "mlp": MLPConfig,
    "rbf": LabelsConfig,
    "table": LabelsConfig,
    "tiles": TilesConfig,
}


def schema_of(kind: str) -> type[ValueConfig]:
    """The keys of a kind of value function, one of `KINDS`; loads torch if they aren't here.

    Raises:
        ImportError: it has a YAML and no file in ``fnnq_torchrl/values/``.
    """
    if kind in _LIGHT:
        return _LIGHT[kind]
    values = import_module("fnnq_torchrl.values")  # by its name, since it stands on this module
    schema: type[ValueConfig] = values.network_of(kind).schema
    return schema


def _unknown(inputs: dict[str, list[Any]], what: str) -> Iterator[OutOfRange]:
    names = ", ".join(OBSERVATIONS)
    if not inputs:
        yield OutOfRange("inputs", inputs, f"{what} for at least one of: {names}")
    for name, given in inputs.items():
        if name not in OBSERVATIONS:
            yield OutOfRange(f"inputs.{name}", given, f"under the name of one of: {names}")
