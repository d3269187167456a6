"""The base of the worlds' configurations: parameters, observations, actions. No torch."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from envs.core.parameters import Parameters, matching, whole
from envs.core.registry import KIND

Range = tuple[float, float]
"""The lowest and the highest number."""


@dataclass
class WorldConfig(Parameters, ABC):
    """The parameters of a world, and its observations, actions and measure.

    A subclass adds its own parameters, each with its range, and defines the observations and the
    actions. The specs of :class:`envs.core.pure.PureEnv` are made from them.
    """

    kind: str = matching(*KIND)
    time_limit_steps: int = whole(1)

    measure: ClassVar[str] = "successes"
    """The score of a test: ``successes``, ``return`` or ``length``, where less is better."""

    successes: ClassVar[str] = "successes"
    """The word for the successes that a test counts, in the plural."""

    action_name: ClassVar[str] = "action"
    """What the action is called in rules."""

    start_values: ClassVar[tuple[str, ...]] = ()
    """The names of the numbers of a fixed start; a world without any has random starts only."""

    @property
    @abstractmethod
    def observations(self) -> Mapping[str, Range]:
        """The observations by their names, each with its range, which may be infinite."""

    @property
    @abstractmethod
    def actions(self) -> Range | int:
        """The range of the action, or the size of a fixed set of actions, numbered from 0."""

    @property
    def returns(self) -> Range | None:
        """The lowest and the highest possible return for any discount; None if unknown."""
        return None

    @property
    def fewest_steps(self) -> int:
        """The least number of steps of an episode, or less."""
        return 1

    @property
    def tested(self) -> "WorldConfig":
        """The world in which the runs are tested."""
        return self
