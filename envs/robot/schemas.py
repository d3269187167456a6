"""The parameters of the robot's worlds; ``conf/env/`` has the values."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from math import floor, pi
from typing import ClassVar

from envs.core.parameters import OutOfRange, flag, number, one_of, whole
from envs.core.world import Range, WorldConfig
from envs.robot.scene import SceneConfig, steps_for


@dataclass(kw_only=True)
class FollowBallConfig(WorldConfig):
    """The parameters of ``follow_ball``; their names end in their units."""

    time_step_s: float = number(above=0)
    speed_mps: float = number(above=0)
    track_width_m: float = number(above=0)

    circle_radius_m: float = number(above=0)
    start_angle_rad: float = number(0, pi)  # the ball starts at φ0 ~ U(−this, this)
    ball_speed_min_radps: float = number(0)
    ball_speed_max_radps: float = number(0)

    catch_distance_m: float = number(above=0)

    bearing_noise_rad: float = number(0)
    field_of_view_rad: float = number(above=0, high=pi)  # the largest |Δθ| seen

    catch_reward: float = number(above=0)
    miss_reward: float = number(high=0)

    change_at: int = whole(0, default=0)  # defaults: of jobs from before these keys
    changed_speed: float = number(0, default=1.0)
    swap_wheels: bool = flag(default=False)

    successes: ClassVar = "catches"
    action_name: ClassVar = "steer"  # Δv: 1 turns right
    start_values: ClassVar = ("angle", "speed")  # the ball's φ0 in rad and ω_b in rad/s

    @property
    def observations(self) -> Mapping[str, Range]:
        """The range of Δθ, the ball's bearing as the robot's head sees it, in rad."""
        return {"bearing": (-self.field_of_view_rad, self.field_of_view_rad)}

    @property
    def actions(self) -> Range:
        """The range of Δv, the wheels' relative speed."""
        return -1.0, 1.0

    @property
    def returns(self) -> Range:
        """The rewards of a miss and of a catch: an episode ends with one and has no other."""
        return self.miss_reward, self.catch_reward

    @property
    def fewest_steps(self) -> int:
        """A lower bound: the steps straight to within the catch distance of the ball's circle."""
        stride_m = self.speed_mps * self.time_step_s
        way_m = self.circle_radius_m - self.catch_distance_m
        return min(self.time_limit_steps, max(1, floor(way_m / stride_m)))

    @property
    def tested(self) -> "FollowBallConfig":
        return self

    def tested_from(self, first_test: Callable[[int], int]) -> WorldConfig:
        world = self.tested
        return replace(world, change_at=first_test(self.change_at)) if self.change_at else world

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield an error if the ball's lowest speed is above its highest."""
        slowest, fastest = self.ball_speed_min_radps, self.ball_speed_max_radps
        if slowest > fastest:
            at_most = f"at most ball_speed_max_radps={fastest}"
            yield OutOfRange("ball_speed_min_radps", slowest, at_most)


@dataclass(kw_only=True)
class FollowOneSideConfig(FollowBallConfig):
    """The parameters of ``follow_one_side``, in which the ball starts on one side.

    Evaluations play in ``follow_ball``, with the ball on both sides.
    """

    start_side: str = one_of("left", "right")
    switch_side_after: int = whole(0)
    other_view_rad: float = number(0, pi)  # the largest |Δθ| seen on the other side

    @property
    def tested(self) -> FollowBallConfig:
        """The configuration of ``follow_ball``, with the ball on both sides."""
        shared = {item.name: getattr(self, item.name) for item in fields(FollowBallConfig)}
        return FollowBallConfig(**(shared | {"kind": "follow_ball"}))


@dataclass(kw_only=True)
class FollowObstaclesConfig(SceneConfig):
    """The parameters of ``follow_obstacles``, in which the robot catches a ball among obstacles."""

    catch_distance_m: float = number(above=0)
    catch_reward: float = number(above=0)
    collision_reward: float = number(high=0)
    miss_reward: float = number(high=0)

    successes: ClassVar = "catches"

    @property
    def returns(self) -> Range:
        """The lowest and the highest return; the only reward comes at the end."""
        return min(self.collision_reward, self.miss_reward), self.catch_reward

    @property
    def fewest_steps(self) -> int:
        """The least number of steps to the nearest obstacle or ball."""
        ways_m = [self.way_to_obstacles_m(), self.way_to_ball_m() - self.catch_distance_m]
        return min(self.time_limit_steps, steps_for(min(ways_m), self.stride_m))

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield the contradictions of the scene, and an error if no ball is of the kind ball."""
        yield from super().contradictions()
        if not any(ball.kind == "ball" for ball in self.ball_entries):
            yield OutOfRange("balls", self.balls, "a list with at least one of the kind ball")


@dataclass(kw_only=True)
class WanderConfig(SceneConfig):
    """The parameters of ``wander``, in which the robot avoids obstacles; there is no ball."""

    step_reward: float = number(0)
    steering_cost: float = number(0)
    collision_reward: float = number(high=0)

    measure: ClassVar = "return"

    @property
    def returns(self) -> Range:
        """The lowest and the highest return: of all steps, or of those before a collision."""
        worst = min(0.0, self.step_reward - self.steering_cost) * self.time_limit_steps
        return worst + self.collision_reward, self.step_reward * self.time_limit_steps

    @property
    def fewest_steps(self) -> int:
        """No obstacle is nearer than its way at the robot's start."""
        return min(self.time_limit_steps, steps_for(self.way_to_obstacles_m(), self.stride_m))

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield what can't be, and collisions that don't end a situation."""
        yield from super().contradictions()
        if self.robot.collision != "end":
            yield OutOfRange("robot.collision", self.robot.collision, "end where one wanders")
