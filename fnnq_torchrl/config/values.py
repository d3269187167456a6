"""The schemas of ``conf/value/``: the keys of every kind of value function. No torch here.

``fnnq_torchrl.agent.values`` has the network of each. A value function of a user's own, whose kind
is ``module:Class``, has its schema in its class.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from envs.core.parameters import (
    OutOfRange,
    Parameters,
    flag,
    matching,
    number,
    one_of,
    pairs,
    rising_pair,
    some_of,
    whole,
    wholes,
)
from envs.robot.schemas import OBSERVATIONS

__all__ = [
    "ACTIVATIONS",
    "SCHEMAS",
    "LabelsConfig",
    "MLPConfig",
    "TilesConfig",
    "ValueConfig",
]

ACTIVATIONS = ("tanh", "relu", "leaky_relu")
"""What the hidden units of an MLP do."""


@dataclass
class ValueConfig(Parameters):
    """What every value function has: its kind."""

    kind: str = matching(r"\w+|[\w.]+:\w+", "the name of a value function, or module:Class")


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


SCHEMAS: dict[str, type[ValueConfig]] = {
    "fnnq": LabelsConfig,
    "mlp": MLPConfig,
    "rbf": LabelsConfig,
    "table": LabelsConfig,
    "tiles": TilesConfig,
}
"""The schemas of the value functions, by their names in ``conf/value/``."""


def _unknown(inputs: dict[str, list[Any]], what: str) -> Iterator[OutOfRange]:
    names = ", ".join(OBSERVATIONS)
    if not inputs:
        yield OutOfRange("inputs", inputs, f"{what} for at least one of: {names}")
    for name, given in inputs.items():
        if name not in OBSERVATIONS:
            yield OutOfRange(f"inputs.{name}", given, f"under the name of one of: {names}")
