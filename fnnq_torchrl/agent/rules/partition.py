"""Variables and their labels: the words of the rules."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isinf, isnan

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

    @property
    def words(self) -> str:
        """The kind and the parameters for messages, such as ``gaussian -0.5 0.4``."""
        return f"{self.kind} {' '.join(f'{number:g}' for number in self.parameters)}"


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

    def gaps(self) -> list[tuple[float, float]]:
        """Find the parts of the range where no label fires.

        Returns:
            The ends of each part, which are equal if it is a single number.
        """
        if not all(label.function.compact for label in self.labels):
            return []
        ends = [end for label in self.labels for end in label.function.support(label.parameters)]
        inside = sorted({end for end in ends if self.low < end < self.high})
        # Between two neighbouring points, a label fires either everywhere or nowhere.
        points = [self.low, *inside, self.high]
        between = [_middle(low, high) for low, high in pairwise(points)]
        x = torch.tensor([*points, *between], dtype=torch.float64)
        silent = (self.log_degrees(x) == -inf).all(0).tolist()
        found: list[tuple[float, float]] = []
        for i, point in enumerate(points):
            if i > 0 and silent[len(points) + i - 1]:
                begin = points[i - 1]
                if found and found[-1][1] == begin:
                    begin = found.pop()[0]
                found.append((begin, point))
            elif silent[i]:
                found.append((point, point))
        return found

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


def _middle(low: float, high: float) -> float:
    """Return a number between two numbers, which may be infinite."""
    if isinf(low):
        return 0.0 if isinf(high) else high - 1
    return low + 1 if isinf(high) else (low + high) / 2
