"""The parameters of the robot's worlds; ``conf/env/`` has the values."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from math import floor, pi
from typing import ClassVar

from envs.core.parameters import OutOfRange, number, one_of, whole
from envs.core.world import Range, WorldConfig


@dataclass
class FollowBallConfig(WorldConfig):
    """Robot, ball, vision and rewards: the units are in the names, the sources in the YAML file."""

    time_step_s: float = number(above=0)
    speed_mps: float = number(above=0)
    track_width_m: float = number(above=0)

    circle_radius_m: float = number(above=0)
    start_angle_rad: float = number(0, pi)  # the ball's: φ0 ~ U(−start_angle_rad, start_angle_rad)
    ball_speed_min_radps: float = number(0)
    ball_speed_max_radps: float = number(0)

    catch_distance_m: float = number(above=0)

    bearing_noise_rad: float = number(0)
    field_of_view_rad: float = number(above=0, high=pi)  # to either side

    catch_reward: float = number(above=0)
    miss_reward: float = number(high=0)

    successes: ClassVar = "catches"
    action_name: ClassVar = "steer"  # Δv: 1 turns right
    start_values: ClassVar = ("angle", "speed")  # the ball's φ0 in rad and ω_b in rad/s

    @property
    def observations(self) -> Mapping[str, Range]:
        """Δθ, the ball's bearing as the robot's head sees it, in rad."""
        return {"bearing": (-self.field_of_view_rad, self.field_of_view_rad)}

    @property
    def actions(self) -> Range:
        """Δv, the wheels' relative speed."""
        return -1.0, 1.0

    @property
    def returns(self) -> Range:
        """The two rewards, one of which ends every episode and is all that it brings."""
        return self.miss_reward, self.catch_reward

    @property
    def fewest_steps(self) -> int:
        """The steps straight to the ball's circle: the ball is always R from the robot's start."""
        stride_m = self.speed_mps * self.time_step_s
        way_m = self.circle_radius_m - self.catch_distance_m
        return min(self.time_limit_steps, max(1, floor(way_m / stride_m)))

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield the lowest speed of the ball if it is above the highest."""
        slowest, fastest = self.ball_speed_min_radps, self.ball_speed_max_radps
        if slowest > fastest:
            at_most = f"at most ball_speed_max_radps={fastest}"
            yield OutOfRange("ball_speed_min_radps", slowest, at_most)


@dataclass
class FollowOneSideConfig(FollowBallConfig):
    """The ball starts on one side of straight ahead, and later on the other.

    The runs are tested in `FollowBallConfig`'s world, with both sides.
    """

    start_side: str = one_of("left", "right")
    switch_side_after: int = whole(0)
    other_view_rad: float = number(0, pi)  # at most; to the other side than start_side

    @property
    def tested(self) -> FollowBallConfig:
        """The world in which the ball starts and is seen on both sides."""
        shared = {item.name: getattr(self, item.name) for item in fields(FollowBallConfig)}
        return FollowBallConfig(**(shared | {"kind": "follow_ball"}))
