"""The parameters of worlds that are made of single environments, without torch."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import ClassVar, NamedTuple

from envs.core.world import Range, WorldConfig

WARM_UP = 2_000
"""The number of random steps by which the range of an observation without limits is measured."""

_ENDLESS = 1e30
"""Limits of at least this size count as infinite; some spaces have float32's largest number."""


class Spaces(NamedTuple):
    """The observations and actions of an environment.

    Attributes:
        observations: the range of each number of an observation, by its name.
        usual: ``observations``, with ranges measured in random play in place of infinite ranges.
        actions: the range of the action, or the number of actions.
    """

    observations: Mapping[str, Range]
    usual: Mapping[str, Range]
    actions: Range | int


@dataclass
class SinglesConfig(WorldConfig):
    """The parameters of a world whose observations and actions its environment defines."""

    measure: ClassVar = "return"
    compiles: ClassVar = False

    @property
    @abstractmethod
    def spaces(self) -> Spaces:
        """The observations and actions of the environment.

        Raises:
            ConfigError: if there is no such environment, or it isn't supported.
        """

    @property
    def observations(self) -> Mapping[str, Range]:
        """The range of each number of an observation."""
        return self.spaces.observations

    @property
    def usual(self) -> Mapping[str, Range]:
        """The range of each number of an observation, measured in 2,000 steps if infinite."""
        return self.spaces.usual

    @property
    def actions(self) -> Range | int:
        """The range of the action, or the number of actions."""
        return self.spaces.actions


def range_of(low: float, high: float) -> Range:
    """Return a range, in which limits that are larger than any real number's are infinite."""
    return _end(low), _end(high)


def is_finite(span: Range) -> bool:
    """Return whether both ends of a range are finite."""
    return -inf < span[0] and span[1] < inf


def usual_ranges(
    spans: Mapping[str, Range], played: Iterator[Sequence[float]]
) -> Mapping[str, Range]:
    """Return the ranges, with ranges measured in random play in place of infinite ranges.

    Args:
        spans: the ranges by name.
        played: the observations of random play, each a number for each range. They are read only if
            a range is infinite.
    """
    if all(map(is_finite, spans.values())):
        return spans
    columns = zip(*played, strict=True)
    return {
        name: span if is_finite(span) else _widened(min(column), max(column))
        for (name, span), column in zip(spans.items(), columns, strict=True)
    }


def _widened(low: float, high: float) -> Range:
    return (low, high) if high > low else (low, low + 1.0)


def _end(limit: float) -> float:
    return float(limit) if abs(limit) < _ENDLESS else inf * (1 if limit > 0 else -1)
