"""The follow-the-ball world for one robot in plain Python floats: slow, and written to be read."""

import math

from envs.robot.schemas import FollowBallConfig, FollowOneSideConfig

from .pcg import draw

FOR_STEP, FOR_START = 0, 1


class FollowBallTwin:
    """One learning situation of one run; its attributes have the names of the env's entries.

    Args:
        world: the physical parameters.
        seed: the seed of the run.
        episode: the number of the situation in the run.
        situation: a fixed start of the ball (φ₀, ω_b) instead of a random one.
    """

    def __init__(
        self,
        world: FollowBallConfig,
        seed: int,
        episode: int,
        situation: tuple[float, float] | None = None,
    ) -> None:
        self.world = world
        self.seed = seed
        self.episode = episode
        self.step = 0
        self.x_m = self.y_m = self.heading_rad = 0.0
        words = draw(seed, episode, 0, FOR_START)
        if situation is None:
            low, high = world.ball_speed_min_radps, world.ball_speed_max_radps
            anticlockwise = words[1] % 2 == 1
            self.ball_angle_rad = world.start_angle_rad * (2 * uniform(words[0]) - 1)
            self.ball_speed_radps = low + (high - low) * uniform(words[1])
            if not anticlockwise:
                self.ball_speed_radps = -self.ball_speed_radps
            if self._one_sided and (self.ball_angle_rad > 0) != self._on_left():
                self.ball_angle_rad = -self.ball_angle_rad
        else:
            self.ball_angle_rad, self.ball_speed_radps = situation
        self.bearing = self._look(words[2], words[3])
        spare = [word % 256 for word in (words[0], words[2], words[3])]
        self.chance = (65536 * spare[0] + 256 * spare[1] + spare[2]) / 2**24

    def move(self, steering: float) -> tuple[float, bool]:
        """Take one time step with steering Δv; return the reward and whether it was the last."""
        world = self.world
        left_mps = world.speed_mps * (1 + steering)
        right_mps = world.speed_mps * (1 - steering)
        self._drive(left_mps, right_mps)
        self.ball_angle_rad += self.ball_speed_radps * world.time_step_s
        self.step += 1
        words = draw(self.seed, self.episode, self.step, FOR_STEP)
        self.bearing = self._look(words[0], words[1])
        self.chance = uniform(words[2])
        if math.hypot(*self._way_to_ball()) < world.catch_distance_m:
            return world.catch_reward, True
        if self.step == world.time_limit_steps:
            return world.miss_reward, True
        return 0.0, False

    def _drive(self, left_mps: float, right_mps: float) -> None:
        """Drive along a circle around the point about which both wheels turn."""
        world = self.world
        speed_mps = (left_mps + right_mps) / 2
        turn_radps = (right_mps - left_mps) / world.track_width_m
        way_m = speed_mps * world.time_step_s
        turn_rad = turn_radps * world.time_step_s
        if abs(turn_rad) < 1e-9:  # the point is too far away: a straight line
            self.x_m += way_m * math.cos(self.heading_rad)
            self.y_m += way_m * math.sin(self.heading_rad)
        else:
            radius_m = way_m / turn_rad  # negative: the point lies to the right
            centre_x_m = self.x_m - radius_m * math.sin(self.heading_rad)
            centre_y_m = self.y_m + radius_m * math.cos(self.heading_rad)
            self.x_m = centre_x_m + radius_m * math.sin(self.heading_rad + turn_rad)
            self.y_m = centre_y_m - radius_m * math.cos(self.heading_rad + turn_rad)
        self.heading_rad += turn_rad

    def _way_to_ball(self) -> tuple[float, float]:
        ball_x_m = self.world.circle_radius_m * math.cos(self.ball_angle_rad)
        ball_y_m = self.world.circle_radius_m * math.sin(self.ball_angle_rad)
        return ball_x_m - self.x_m, ball_y_m - self.y_m

    def _look(self, word: int, other: int) -> float:
        east_m, north_m = self._way_to_ball()
        true_rad = math.remainder(math.atan2(north_m, east_m) - self.heading_rad, math.tau)
        seen_rad = true_rad + self.world.bearing_noise_rad * normal(word, other)
        left_rad = right_rad = self.world.field_of_view_rad
        if self._one_sided:
            other_rad = min(left_rad, self.world.other_view_rad)
            left_rad, right_rad = (
                (left_rad, other_rad) if self._on_left() else (other_rad, left_rad)
            )
        return max(-right_rad, min(left_rad, seen_rad))

    @property
    def _one_sided(self) -> bool:
        return isinstance(self.world, FollowOneSideConfig)

    def _on_left(self) -> bool:
        """Return True if the ball starts on the left in this situation of a one-sided world."""
        switched = 0 < self.world.switch_side_after <= self.episode
        return (self.world.start_side == "left") != switched


def uniform(word: int) -> float:
    return (word // 256) / 2**24


def normal(word: int, other: int) -> float:
    """Return a normal random number from two words, by Box and Muller's transform."""
    return math.sqrt(-2 * math.log(1 - uniform(word))) * math.cos(math.tau * uniform(other))
