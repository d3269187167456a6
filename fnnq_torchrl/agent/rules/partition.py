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
        name: its word.
        kind: of :data:`.MEMBERSHIP_FUNCTIONS`.
        parameters: the membership function's, in the registry's order.

    Raises:
        RulesError: on creation, if there is no such function or it doesn't have such parameters.
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
        """Its entry in the registry."""
        return MEMBERSHIP_FUNCTIONS[self.kind]


@dataclass(frozen=True)
class Variable:
    """An input of a rule base.

    Attributes:
        name: as the observation's or the action's.
        labels: at least one, each with a name of its own.
        low, high: its range, which may be infinite.

    Raises:
        RulesError: on creation, if that doesn't hold.
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
        """The labels' words."""
        return [label.name for label in self.labels]

    def log_degrees(self, x: Tensor, elsewhere: str = "zero") -> Tensor:
        """Log μ(x) of every label.

        Args:
            x: ``[*points]``.
            elsewhere: with ``nearest``, the label that is nearest has degree 1 where none fires.

        Returns:
            ``[labels, *points]``; −∞ where a label doesn't fire.
        """
        labels = [(label.kind, [*map(x.new_tensor, label.parameters)]) for label in self.labels]
        return log_degrees(x, labels, elsewhere)

    def gaps(self, points: int = 10_001) -> list[tuple[float, float]]:
        """Parts of the range where no label fires, between neighbours of so many points.

        Where the range is infinite, it is looked at between the labels only.
        """
        span = self.span()
        x = torch.linspace(*span, points, dtype=torch.float64)
        silent = (self.log_degrees(x) == -inf).all(0)
        return _stretches(x.tolist(), silent.tolist())

    def span(self) -> tuple[float, float]:
        """The range or, where it is infinite, what the labels' parameters span, and some more."""
        inside = [label.function.middle(label.parameters) for label in self.labels]
        margin = (max(inside) - min(inside)) / 2 or 1.0
        low = self.low if self.low > -inf else min(*inside, self.high) - margin
        high = self.high if self.high < inf else max(*inside, low) + margin
        return low, high


def repeated(names: Sequence[str]) -> str | None:
    """The first name that stands there twice, if any does."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def _stretches(x: Sequence[float], marked: Sequence[bool]) -> list[tuple[float, float]]:
    """The first and the last of each unbroken stretch of marked numbers."""
    found: list[tuple[float, float]] = []
    for i, (number, mark) in enumerate(zip(x, marked, strict=True)):
        if mark and i > 0 and marked[i - 1]:
            found[-1] = (found[-1][0], number)
        elif mark:
            found.append((number, number))
    return found
