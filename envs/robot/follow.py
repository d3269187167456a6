"""The paper's task as a TorchRL environment: a robot on two wheels follows a rolling ball."""

from typing import ClassVar

import torch
from torch import Tensor

from envs.core import streams
from envs.core.pure import Entries, PureEnv
from envs.core.streams import Stream
from envs.robot import balls, kinematics, outcome, vision
from envs.robot.schemas import FollowBallConfig


class FollowBall(PureEnv):
    """A batch of robots, each alone on a plane with one ball to catch.

    An episode is called a situation. The world's entries, each ``[*batch_size, 1]``:

    ===================================  =========================================================
    ``bearing``                          Δθ, the ball's bearing as the head sees it, rad (observed)
    ``action``                           Δv in [−1, 1], the wheels' relative speed
    ``reward``                           1 for a catch, −0.5 for a miss, else 0 (by default)
    ``terminated``                       the situation has ended, by a catch or a miss
    ``success``                          the situation has ended by a catch
    ``x_m``, ``y_m``, ``heading_rad``    the robot's pose
    ``ball_angle_rad``                   φ, the ball's position on its circle
    ``ball_speed_radps``                 ω_b, its angular speed along the circle
    ===================================  =========================================================

    In the episodes from ``change_at`` on, unless it is 0, the ball rolls ``changed_speed`` times as
    fast as its speed says, and with ``swap_wheels`` the wheels are swapped.

    :class:`envs.core.pure.PureEnv` has further entries. A fixed start is (φ₀, ω_b), in rad and
    rad/s.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/follow_ball.yaml``.
    """

    schema = FollowBallConfig
    state_keys: ClassVar[tuple[str, ...]] = (
        "x_m",
        "y_m",
        "heading_rad",
        "ball_angle_rad",
        "ball_speed_radps",
    )
    world: FollowBallConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        u, v, *noise = streams.uniform(words, self.dtype)
        first, second, *others = words
        if situations is None:
            angle_rad, speed_radps = self._draw_ball(u, v, streams.coin(second), episode)
        else:
            angle_rad, speed_radps = situations.clone().tensor_split(2, -1)
        state = {key: torch.zeros_like(angle_rad) for key in ("x_m", "y_m", "heading_rad")}
        state |= {"ball_angle_rad": angle_rad, "ball_speed_radps": speed_radps}
        # From the circle's centre, a ball at φ is seen in the direction φ.
        noise_rad = self.world.bearing_noise_rad * streams.box_muller(*noise)
        state["bearing"] = self._look(angle_rad, 0, noise_rad, episode)
        state["chance"] = streams.spare_uniform((first, *others), self.dtype)
        return state

    def transition(self, state: Entries, action: Tensor) -> Entries:
        world = self.world
        x_m, y_m, heading_rad = kinematics.drive(
            state["x_m"],
            state["y_m"],
            state["heading_rad"],
            *kinematics.wheel_speeds(
                self._steering(action, state["episode"]), self._speed_mps(state)
            ),
            world.track_width_m,
            world.time_step_s,
        )
        ball, ball_x_m, ball_y_m = self._roll(state)
        east_m, north_m = ball_x_m - x_m, ball_y_m - y_m
        words = streams.draw(state["seed"], state["episode"], state["step"], Stream.STEP)
        u, v, chance, _ = streams.uniform(words, self.dtype)
        noise_rad = self._noise_rad(state) * streams.box_muller(u, v)
        direction_rad = torch.atan2(north_m, east_m)
        reward, terminated, caught = outcome.judge(
            east_m,
            north_m,
            state["step"],
            catch_distance_m=world.catch_distance_m,
            time_limit_steps=world.time_limit_steps,
            catch_reward=world.catch_reward,
            miss_reward=world.miss_reward,
        )
        return {
            "x_m": x_m,
            "y_m": y_m,
            "heading_rad": heading_rad,
            **ball,
            "bearing": self._look(direction_rad, heading_rad, noise_rad, state["episode"]),
            "chance": chance,
            "reward": reward,
            "terminated": terminated,
            "success": caught,
        }

    def _speed_mps(self, state: Entries) -> float | Tensor:
        """Return V₀, the speed of both wheels if Δv = 0."""
        return self.world.speed_mps

    def _noise_rad(self, state: Entries) -> float | Tensor:
        """Return the standard deviation of the bearing's error."""
        return self.world.bearing_noise_rad

    def _changed(self, episode: Tensor, before: Tensor, after: Tensor) -> Tensor:
        """Return ``after`` in the episodes from ``change_at`` on, and ``before`` in those before.

        Test episodes have other numbers: :meth:`.WorldConfig.tested_from` moves ``change_at``.
        """
        return torch.where(episode >= self.world.change_at, after, before)

    def _steering(self, action: Tensor, episode: Tensor) -> Tensor:
        """Return Δv, which is reversed once the wheels are swapped."""
        world = self.world
        if not (world.change_at and world.swap_wheels):
            return action
        return self._changed(episode, action, -action)

    def _draw_ball(
        self, u: Tensor, v: Tensor, heads: Tensor, episode: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return a random start of the ball: φ₀ in rad and ω_b in rad/s."""
        world = self.world
        speeds_radps = world.ball_speed_min_radps, world.ball_speed_max_radps
        return balls.random_start(u, v, heads, world.start_angle_rad, speeds_radps)

    def _roll(self, state: Entries) -> tuple[Entries, Tensor, Tensor]:
        """Return the ball's state after a step, and its x and y in m."""
        world, speed_radps = self.world, state["ball_speed_radps"]
        present_radps = speed_radps
        if world.change_at and world.changed_speed != 1:
            faster_radps = world.changed_speed * speed_radps
            present_radps = self._changed(state["episode"], speed_radps, faster_radps)
        angle_rad = balls.roll(state["ball_angle_rad"], present_radps, world.time_step_s)
        entries = {"ball_angle_rad": angle_rad, "ball_speed_radps": speed_radps}
        return entries, *balls.position(angle_rad, world.circle_radius_m)

    def _look(
        self,
        direction_rad: Tensor,
        heading_rad: Tensor | float,
        noise_rad: Tensor,
        episode: Tensor,
    ) -> Tensor:
        """Return the bearing that the head reports for a ball in ``direction_rad``."""
        edge_rad = self.world.field_of_view_rad
        return vision.bearing(direction_rad, heading_rad, noise_rad, edge_rad)
