"""Variables and their labels: the words of the rules."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isnan

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.errors import RulesError, choices, shown
from fnnq_torchrl.equations.membership import log_degrees
from fnnq_torchrl.equations.membership_functions import MEMBERSHIP_FUNCTIONS, MembershipFunction


@dataclass(frozen=True)
class Label:
    """A label of a variable, a fuzzy set.

    Attributes:
        name: the label's name, a word of the rules.
        kind: the membership function, a key of :data:`.MEMBERSHIP_FUNCTIONS`.
        parameters: the membership function's parameters, in the registry's order.

    Raises:
        RulesError: on creation, if the kind is unknown or the parameters are invalid.
    """

    name: str
    kind: str
    parameters: tuple[float, ...]

    def __post_init__(self) -> None:
        if self.kind not in MEMBERSHIP_FUNCTIONS:
            raise RulesError(f"{shown(self.kind)}: {choices(self.kind, MEMBERSHIP_FUNCTIONS)}")
        if misfit := self.function.misfit(self.parameters):
            given = shown([*self.parameters])
            raise RulesError(f"label {shown(self.name)}: {self.kind} {given} must be {misfit}")

    @property
    def function(self) -> MembershipFunction:
        """The label's membership function."""
        return MEMBERSHIP_FUNCTIONS[self.kind]


@dataclass(frozen=True)
class Variable:
    """An input of a rule base.

    Attributes:
        name: the name of the observation or the action.
        labels: at least one label; their names differ.
        low, high: the range's ends, which may be infinite; low < high.

    Raises:
        RulesError: on creation, if these conditions don't hold.
    """

    name: str
    labels: tuple[Label, ...]
    low: float = -inf
    high: float = inf

    def __post_init__(self) -> None:
        if isnan(self.low) or isnan(self.high) or self.low >= self.high:
            raise RulesError(f"{shown(self.name)}: its range [{self.low}, {self.high}] is empty")
        if not self.labels:
            raise RulesError(f"{shown(self.name)} has no label")
        if twice := repeated(self.names):
            raise RulesError(f"{shown(self.name)} has two labels {shown(twice)}")

    @property
    def names(self) -> list[str]:
        """The labels' names."""
        return [label.name for label in self.labels]

    def log_degrees(self, x: Tensor, elsewhere: str = "zero") -> Tensor:
        """Return log μ(x) of every label.

        Args:
            x: ``[*points]``.
            elsewhere: with ``nearest``, the nearest label has degree 1 at points where none fires.

        Returns:
            ``[labels, *points]``; −∞ where a label doesn't fire.
        """
        labels = [(label.kind, [*map(x.new_tensor, label.parameters)]) for label in self.labels]
        return log_degrees(x, labels, elsewhere)

    def gaps(self, points: int = 10_001) -> list[tuple[float, float]]:
        """Find the parts of the range where no label fires, on a grid.

        Args:
            points: the number of grid points over :meth:`span`.

        Returns:
            The first and the last grid point of each part.
        """
        span = self.span()
        x = torch.linspace(*span, points, dtype=torch.float64)
        silent = (self.log_degrees(x) == -inf).all(0)
        return _stretches(x.tolist(), silent.tolist())

    def span(self) -> tuple[float, float]:
        """Return the range; an infinite end becomes the outermost label's middle plus a margin."""
        inside = [label.function.middle(label.parameters) for label in self.labels]
        margin = (max(inside) - min(inside)) / 2 or 1.0
        low = self.low if self.low > -inf else min(*inside, self.high) - margin
        high = self.high if self.high < inf else max(*inside, low) + margin
        return low, high


def repeated(names: Sequence[str]) -> str | None:
    """Return the first name that occurs twice, or None."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def _stretches(x: Sequence[float], marked: Sequence[bool]) -> list[tuple[float, float]]:
    """Return the first and the last number of each unbroken stretch of marked numbers."""
    found: list[tuple[float, float]] = []
    for i, (number, mark) in enumerate(zip(x, marked, strict=True)):
        if mark and i > 0 and marked[i - 1]:
            found[-1] = (found[-1][0], number)
        elif mark:
            found.append((number, number))
    return found
