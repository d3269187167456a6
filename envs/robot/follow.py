"""The paper's task as a TorchRL environment: a robot on two wheels follows a rolling ball."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Composite, TensorSpec, Unbounded

from envs.core import streams
from envs.core.pure import WHEN, PureEnv
from envs.core.streams import Stream
from envs.robot import balls, kinematics, outcome, side, vision
from envs.robot.schemas import World

_REAL = "x_m", "y_m", "heading_rad", "ball_angle_rad", "ball_speed_radps"


class FollowBall(PureEnv):
    """A batch of robots, each with a ball of its own, on planes that share nothing.

    Entries of the TensorDicts, each of shape ``[*batch_size, 1]``:

    ===================================  =========================================================
    ``bearing``                          Δθ, where the head sees the ball, rad (the observation)
    ``chance``                           U[0, 1), for whoever chooses the action
    ``action``                           Δv in [−1, 1], the wheels' relative speed
    ``reward``                           1 for a catch, −0.5 for a miss, else 0 (by default)
    ``done``, ``terminated``             the situation has ended, by a catch or a miss
    ``x_m``, ``y_m``, ``heading_rad``    the robot's pose
    ``ball_angle_rad``                   φ, the ball's place on its circle
    ``ball_speed_radps``                 ω_b, how fast it rolls along it
    ``seed``, ``episode``, ``step``      whose random numbers these are, and when (int64)
    ===================================  =========================================================

    Args:
        world: the physical parameters (``conf/env/follow_ball.yaml`` has the paper's).
        batch_size: the shape of the batch of runs; ``()`` is a single one.
        situations: fixed starts of the ball (φ₀, ω_b) in rad and rad/s, of a shape that broadcasts
            to ``[*batch_size, 2]``; by default every situation is drawn at random.
        seed: an integer (run i of the batch gets ``seed + i``) or the seeds themselves, int64 of
            shape ``batch_size``.
        dtype: of everything real.
        device: of everything.
    """

    def __init__(
        self,
        world: World,
        batch_size: Sequence[int] = (),
        *,
        situations: Tensor | None = None,
        seed: int | Tensor = 0,
        dtype: torch.dtype = torch.float32,
        device: torch.device | str | None = None,
    ) -> None:
        super().__init__(batch_size, seed, dtype, device)
        self.world = world
        if situations is not None:
            situations = situations.to(device, dtype).expand(*self.batch_size, 2).clone()
        self.register_buffer("situations", situations)
        self._make_specs()

    def _make_specs(self) -> None:
        shape = (*self.batch_size, 1)
        real = {"shape": shape, "dtype": self.dtype, "device": self.device}
        state = {key: Unbounded(**real) for key in _REAL}
        state |= {key: Unbounded(shape, dtype=torch.int64, device=self.device) for key in WHEN}
        view = self.world.field_of_view_rad

        def composite(**entries: TensorSpec) -> Composite:
            return Composite(entries, shape=self.batch_size, device=self.device)

        def flag() -> Binary:
            return Binary(1, shape, dtype=torch.bool, device=self.device)

        self.state_spec = composite(**state)
        seen = {"bearing": Bounded(-view, view, **real), "chance": Bounded(0, 1, **real)}
        self.observation_spec = composite(**seen, **state).clone()
        self.action_spec = Bounded(-1, 1, **real)
        self.reward_spec = Unbounded(**real)
        self.done_spec = composite(done=flag(), terminated=flag())

    @property
    def fewest_steps(self) -> int:
        """No situation ends in fewer steps: the ball is always R from where the robot starts."""
        world = self.world
        stride_m = world.speed_mps * world.time_step_s
        way_m = world.circle_radius_m - world.catch_distance_m
        return min(world.time_limit_steps, max(1, math.floor(way_m / stride_m)))

    def start(self, seed: Tensor, episode: Tensor, situations: Tensor | None = None) -> TensorDict:
        """The first state of an episode.

        Args:
            seed, episode: int64 ``[*batch_size, 1]``.
            situations: starts of the ball, ``[*batch_size, 2]``, instead of the environment's own.
        """
        world = self.world
        situations = self.situations if situations is None else situations
        words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        if situations is None:
            angle_rad, speed_radps = balls.random_start(
                words[0],
                words[1],
                world.start_angle_rad,
                (world.ball_speed_min_radps, world.ball_speed_max_radps),
                self.dtype,
            )
            if world.start_side != "both":
                angle_rad = side.mirrored(angle_rad, self._side(episode))
        else:
            angle_rad, speed_radps = situations.clone().split(1, -1)
        pose = {key: torch.zeros_like(angle_rad) for key in ("x_m", "y_m", "heading_rad")}
        rolling = {"ball_angle_rad": angle_rad, "ball_speed_radps": speed_radps}
        when = {"seed": seed, "episode": episode, "step": torch.zeros_like(episode)}
        state = pose | rolling | when
        # From the circle's centre, a ball at φ is seen in the direction φ.
        state["bearing"] = self._look(angle_rad, 0, words[2:], episode)
        state["chance"] = streams.spare_uniform((words[0], words[2], words[3]), self.dtype)
        return self.pack(state)

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        world = self.world
        state = {key: tensordict[key] for key in (*_REAL, *WHEN)}
        wheels = kinematics.wheel_speeds(tensordict["action"], world.speed_mps)
        state["x_m"], state["y_m"], state["heading_rad"] = kinematics.drive(
            state["x_m"],
            state["y_m"],
            state["heading_rad"],
            *wheels,
            world.track_width_m,
            world.time_step_s,
        )
        state["ball_angle_rad"] = balls.roll(
            state["ball_angle_rad"], state["ball_speed_radps"], world.time_step_s
        )
        state["step"] = state["step"] + 1
        words = streams.draw(state["seed"], state["episode"], state["step"], Stream.STEP)
        ball_x_m, ball_y_m = balls.position(state["ball_angle_rad"], world.circle_radius_m)
        east_m, north_m = ball_x_m - state["x_m"], ball_y_m - state["y_m"]
        direction_rad = torch.atan2(north_m, east_m)
        state["bearing"] = self._look(
            direction_rad, state["heading_rad"], words[:2], state["episode"]
        )
        state["chance"] = streams.uniform(words[2], self.dtype)
        state["reward"], state["terminated"] = outcome.judge(
            east_m,
            north_m,
            state["step"],
            catch_distance_m=world.catch_distance_m,
            time_limit_steps=world.time_limit_steps,
            catch_reward=world.catch_reward,
            miss_reward=world.miss_reward,
        )
        state["done"] = state["terminated"].clone()
        return self.pack(state)

    def _look(
        self,
        direction_rad: Tensor,
        heading_rad: Tensor | float,
        noise_words: tuple[Tensor, Tensor],
        episode: Tensor,
    ) -> Tensor:
        """The bearing of a ball in that direction, as seen."""
        world = self.world
        noise_rad = world.bearing_noise_rad * streams.normal(*noise_words, self.dtype)
        seen_rad = vision.bearing(direction_rad, heading_rad, noise_rad, world.field_of_view_rad)
        if world.start_side == "both":
            return seen_rad
        return side.clipped(seen_rad, self._side(episode), world.other_view_rad)

    def _side(self, episode: Tensor) -> Tensor | float:
        world = self.world
        return side.sign(episode, world.start_side, world.switch_side_after, self.dtype)
