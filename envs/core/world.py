"""The base class of the worlds' configurations, without torch."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from envs.core.parameters import Parameters, matching, whole
from envs.core.registry import KIND

Range = tuple[float, float]
"""The lowest and the highest number."""


@dataclass
class WorldConfig(Parameters, ABC):
    """The parameters of a world, and its observations, actions and measure.

    A subclass adds its own parameters, each with its range, and defines ``observations`` and
    ``actions``. :class:`envs.core.pure.PureEnv` makes its specs from these two.
    """

    kind: str = matching(*KIND)
    time_limit_steps: int = whole(1)

    measure: ClassVar[str] = "successes"
    """The score of a test: ``successes``, ``return`` or ``length`` (a smaller one is better)."""

    successes: ClassVar[str] = "successes"
    """The plural noun for the successes that a test counts, such as ``catches``."""

    compiles: ClassVar[bool] = True
    """Whether a step of the world uses plain torch only, so that it can be compiled."""

    graded: ClassVar[bool] = False
    """Whether a world with a fixed set of actions also takes a number between two of them."""

    action_name: ClassVar[str] = "action"
    """What the action is called in rules."""

    start_values: ClassVar[tuple[str, ...]] = ()
    """The names of the numbers that define a fixed start; none if all starts are random."""

    @property
    @abstractmethod
    def observations(self) -> Mapping[str, Range]:
        """The range of each observation, by name; a range may be infinite."""

    @property
    def usual(self) -> Mapping[str, Range]:
        """The part of each observation's range that tiles and even labels cover; by default all."""
        return self.observations

    @property
    @abstractmethod
    def actions(self) -> Range | int:
        """The range of the action, or the number of actions in a fixed set, with indices from 0."""

    @property
    def returns(self) -> Range | None:
        """The lowest and the highest possible return for any discount; None if unknown."""
        return None

    @property
    def fewest_steps(self) -> int:
        """A lower bound of the steps in an episode."""
        return 1

    @property
    def steps_of_situation(self) -> int | None:
        """The steps that count as a situation in a world without end; None where episodes end."""
        return None

    @property
    def tested(self) -> "WorldConfig":
        """The configuration of the world in which evaluations play; by default this one."""
        return self

    def tested_from(self, first_test: Callable[[int], int]) -> "WorldConfig":
        """Return the configuration in which evaluations play, for a world that changes in time.

        Args:
            first_test: returns the number of the first test episode that is played after so many
                situations of learning, or more.
        """
        return self.tested
