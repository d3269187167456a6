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
    """The parameters of a world, and what it offers to a learner.

    A subclass adds its own parameters, each with its range, and says what it offers. The specs of
    the environment (:class:`envs.core.pure.PureEnv`) are made from that.
    """

    kind: str = matching(*KIND)
    time_limit_steps: int = whole(1)

    measure: ClassVar[str] = "successes"
    """The score of a test: ``successes``, ``return``, or ``length``, of which less is better."""

    action_name: ClassVar[str] = "action"
    """What the action is called in rules."""

    start_values: ClassVar[tuple[str, ...]] = ()
    """The numbers that a fixed start consists of; a world without any has random starts only."""

    @property
    @abstractmethod
    def observations(self) -> Mapping[str, Range]:
        """The observations by their names, each with its range; infinities where it has none."""

    @property
    @abstractmethod
    def actions(self) -> Range | int:
        """The range of the action, or of a fixed set of actions, numbered from 0, their number."""

    @property
    def returns(self) -> Range | None:
        """The lowest and the highest return there can be, whatever the discount, if it is known."""
        return None

    @property
    def fewest_steps(self) -> int:
        """A number of steps before which no episode ends."""
        return 1

    @property
    def tested(self) -> "WorldConfig":
        """The world in which the runs are tested."""
        return self
