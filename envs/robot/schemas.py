"""The parameters of the follow-the-ball world; ``conf/env/follow_ball.yaml`` has the values."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import pi
from typing import Self

from envs.core.parameters import OutOfRange, Parameters, number, one_of, whole

OBSERVATIONS = ("bearing",)
"""The names under which the world offers what its robot sees."""


@dataclass
class World(Parameters):
    """Robot, ball, vision and rewards: the units are in the names, the sources in the YAML file."""

    time_step_s: float = number(above=0)
    speed_mps: float = number(above=0)
    track_width_m: float = number(above=0)

    circle_radius_m: float = number(above=0)
    start_angle_rad: float = number(0, pi)  # the ball's: φ0 ~ U(−start_angle_rad, start_angle_rad)
    start_side: str = one_of("both", "left", "right")
    switch_side_after: int = whole(0)
    ball_speed_min_radps: float = number(0)
    ball_speed_max_radps: float = number(0)

    catch_distance_m: float = number(above=0)
    time_limit_steps: int = whole(1)

    bearing_noise_rad: float = number(0)
    field_of_view_rad: float = number(above=0, high=pi)  # to either side
    other_view_rad: float = number(0, pi)  # at most; to the other side than start_side

    catch_reward: float = number(above=0)
    miss_reward: float = number(high=0)  # what pays is a catch, and nothing else

    @property
    def largest_return(self) -> float:
        """No |return| is larger, whatever the discount: there is one reward, at the end."""
        return max(self.catch_reward, -self.miss_reward)

    def contradictions(self) -> Iterator[OutOfRange]:
        """A slowest ball that is faster than the fastest; a switch of sides, and none named."""
        slowest, fastest = self.ball_speed_min_radps, self.ball_speed_max_radps
        if slowest > fastest:
            at_most = f"at most ball_speed_max_radps={fastest}"
            yield OutOfRange("ball_speed_min_radps", slowest, at_most)
        if self.start_side == "both" and self.switch_side_after:
            yield OutOfRange("switch_side_after", self.switch_side_after, "0 with start_side=both")

    def on_both_sides(self) -> Self:
        """The same world, but the ball starts on either side and is seen there."""
        return replace(self, start_side="both", switch_side_after=0)
