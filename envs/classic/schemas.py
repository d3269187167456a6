"""The parameters of the classic worlds; ``conf/env/`` has the values."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf, pi
from typing import Any, ClassVar

from envs.core.parameters import OutOfRange, flag, number, or_null, rising_pair, whole
from envs.core.world import Range, WorldConfig


@dataclass
class MountainCarConfig(WorldConfig):
    """The parameters of ``mountain_car``. Position and velocity have no units in the sources."""

    lowest_position: float = number()
    highest_position: float = number()
    goal_position: float = number()
    highest_speed: float = number(above=0)
    force: float = number(above=0)
    gravity: float = number(above=0)
    start_position: list[float] = rising_pair("lowest", "highest")  # x ~ U(lowest, highest)

    measure: ClassVar = "return"
    successes: ClassVar = "arrivals"
    graded: ClassVar = True
    action_name: ClassVar = "throttle"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The ranges of x and v."""
        return {
            "position": (self.lowest_position, self.highest_position),
            "velocity": (-self.highest_speed, self.highest_speed),
        }

    @property
    def actions(self) -> int:
        """The number of actions: reverse, neutral, forward."""
        return 3

    @property
    def returns(self) -> Range:
        """The lowest and the highest return; a step costs 1."""
        return -float(self.time_limit_steps), -1.0

    @property
    def fewest_steps(self) -> int:
        """The number of steps from the nearest start to the goal at the greatest acceleration."""
        position, speed, steps = self.start_position[1], 0.0, 0
        while position < self.goal_position and steps < self.time_limit_steps:
            speed = min(speed + self.force + self.gravity, self.highest_speed)
            position, steps = position + speed, steps + 1
        return max(1, steps)

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield an error if the start or the goal isn't on the road."""
        lowest, highest = self.lowest_position, self.highest_position
        start = self.start_position
        if not lowest <= start[0] < start[1] < self.goal_position:
            on = f"a pair from lowest_position={lowest} to goal_position={self.goal_position}"
            yield OutOfRange("start_position", start, on)
        if self.goal_position > highest:
            at_most = f"at most highest_position={highest}"
            yield OutOfRange("goal_position", self.goal_position, at_most)


@dataclass
class CartPoleConfig(WorldConfig):
    """The parameters of ``cart_pole``; their names end in their units."""

    time_step_s: float = number(above=0)
    gravity_mps2: float = number(above=0)
    cart_kg: float = number(above=0)
    pole_kg: float = number(above=0)
    half_pole_m: float = number(above=0)
    force_n: float = number(above=0)
    track_m: float = number(above=0)  # the cart leaves the track at ±this
    largest_angle_rad: float = number(above=0, high=pi / 2)  # the pole has fallen beyond ±this
    start: float = number(0)  # each number of the state ~ U(−this, this)
    step_reward: float = number()
    fall_reward: float = number()
    usual_cart_mps: float = number(above=0)
    usual_pole_radps: float = number(above=0)

    successes: ClassVar = "balanced episodes"
    graded: ClassVar = True
    action_name: ClassVar = "push"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The ranges of the cart's place and speed and of the pole's angle and angular speed.

        The state after a fall lies beyond the limits. As in Gymnasium, the ranges are twice the
        limits, so that they contain this state.
        """
        return {
            "cart_m": (-2 * self.track_m, 2 * self.track_m),
            "cart_mps": (-inf, inf),
            "pole_rad": (-2 * self.largest_angle_rad, 2 * self.largest_angle_rad),
            "pole_radps": (-inf, inf),
        }

    @property
    def usual(self) -> Mapping[str, Range]:
        """The limits of place and angle, and the speeds at which the pole can still be balanced."""
        return {
            "cart_m": (-self.track_m, self.track_m),
            "cart_mps": (-self.usual_cart_mps, self.usual_cart_mps),
            "pole_rad": (-self.largest_angle_rad, self.largest_angle_rad),
            "pole_radps": (-self.usual_pole_radps, self.usual_pole_radps),
        }

    @property
    def actions(self) -> int:
        """The number of actions: a push to the left, a push to the right."""
        return 2

    @property
    def returns(self) -> Range:
        """The lowest and the highest return: of no steps or all steps, with and without a fall."""
        of_steps = self.step_reward * self.time_limit_steps
        ends = 0.0, self.fall_reward, of_steps, of_steps + self.fall_reward - self.step_reward
        return min(ends), max(ends)


@dataclass
class AcrobotConfig(WorldConfig):
    """The parameters of ``acrobot``; their names end in their units."""

    time_step_s: float = number(above=0)
    torque_nm: float = number(above=0)
    start: float = number(0)  # each number of the state ~ U(−this, this)
    cosines: bool = flag(default=False)  # older jobs have no such key

    measure: ClassVar = "return"
    successes: ClassVar = "swings"
    graded: ClassVar = True
    action_name: ClassVar = "torque"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The ranges of both joints' angles, or their cosines and sines, and angular speeds."""
        parts = ("cosine1", "sine1", "cosine2", "sine2")
        angles = {"angle1_rad": (-pi, pi), "angle2_rad": (-pi, pi)}
        return {
            **(dict.fromkeys(parts, (-1.0, 1.0)) if self.cosines else angles),
            "speed1_radps": (-4 * pi, 4 * pi),
            "speed2_radps": (-9 * pi, 9 * pi),
        }

    @property
    def actions(self) -> int:
        """The number of actions: a torque to the left, no torque, a torque to the right."""
        return 3

    @property
    def returns(self) -> Range:
        """The lowest and the highest return; a step costs 1, unless it ends above the bar."""
        return -float(self.time_limit_steps), 0.0


@dataclass
class RandomWalkConfig(WorldConfig):
    """The parameters of ``random_walk``."""

    states: int = whole(1)
    left_reward: float = number()
    right_reward: float = number()

    successes: ClassVar = "ends on the right"
    action_name: ClassVar = "step"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The place, from 1 to the number of states; 0 and the number above it are the ends."""
        return {"place": (0.0, self.states + 1.0)}

    @property
    def usual(self) -> Mapping[str, Range]:
        """The places that aren't ends."""
        return {"place": (1.0, float(max(2, self.states)))}

    @property
    def actions(self) -> int:
        """The number of actions: one, because chance alone decides between left and right."""
        return 1

    @property
    def returns(self) -> Range:
        """The lowest and the highest return: the rewards of the ends, or 0 without an end."""
        low, high = sorted((self.left_reward, self.right_reward))
        return min(low, 0.0), max(high, 0.0)

    @property
    def middle(self) -> int:
        """The place of the start."""
        return (self.states + 1) // 2

    @property
    def fewest_steps(self) -> int:
        """The steps from the middle straight to the nearer end."""
        return min(self.time_limit_steps, self.middle)


@dataclass
class ChainConfig(WorldConfig):
    """The parameters of ``chain``."""

    length: int = whole(2)
    choices: int = whole(2)
    setback: Any = or_null(whole(1))
    goal_reward: float = number(above=0)

    measure: ClassVar = "length"
    successes: ClassVar = "arrivals"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The place, from 1 to the length; the number above it is the end."""
        return {"place": (1.0, self.length + 1.0)}

    @property
    def usual(self) -> Mapping[str, Range]:
        """The places in which an action is chosen."""
        return {"place": (1.0, float(self.length))}

    @property
    def actions(self) -> int:
        """The number of actions, of which one is right in each state."""
        return self.choices

    @property
    def returns(self) -> Range:
        """The lowest and the highest return."""
        return 0.0, self.goal_reward

    @property
    def fewest_steps(self) -> int:
        """The steps of the right actions."""
        return min(self.time_limit_steps, self.length)


@dataclass
class TwoStatesConfig(WorldConfig):
    """The parameters of ``two_states``."""

    noise: float = number(above=0)

    measure: ClassVar = "return"
    action_name: ClassVar = "step"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The place, 1 or 2."""
        return {"place": (1.0, 2.0)}

    @property
    def actions(self) -> int:
        """The number of actions: one, without an effect."""
        return 1

    @property
    def returns(self) -> Range:
        """The lowest and the highest return."""
        most = self.noise * self.time_limit_steps
        return -most, most


@dataclass
class RingConfig(WorldConfig):
    """The parameters of ``ring``, a world without end."""

    states: int = whole(2)
    far_reward: float = number()
    switch_after_steps: int = whole(0)
    switched_reward: float = number()
    situation_steps: int = whole(1)

    measure: ClassVar = "return"
    action_name: ClassVar = "turn"

    @property
    def observations(self) -> Mapping[str, Range]:
        """The number of the state."""
        return {"state": (0.0, self.states - 1.0)}

    @property
    def actions(self) -> int:
        """The number of actions: left, right."""
        return 2

    @property
    def returns(self) -> Range:
        """The lowest and the highest return of a situation."""
        largest = max(1.0, abs(self.far_reward), abs(self.switched_reward))
        return -largest * self.situation_steps, largest * self.situation_steps

    @property
    def fewest_steps(self) -> int:
        """The steps of a situation."""
        return self.situation_steps

    @property
    def steps_of_situation(self) -> int:
        return self.situation_steps

    @property
    def tested(self) -> "RingConfig":
        """The ring in tests, which end after the steps of a situation."""
        return replace(self, time_limit_steps=self.situation_steps)
