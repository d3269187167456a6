"""The robot's worlds in which somebody moves the objects and changes the robot between the steps.

In addition to what each world has, the state has these entries, which a step doesn't change. The
caller writes them between the steps.

=====================  =====================================================================
``held``               for each ball, above 0 if a step doesn't move it, ``[*batch, balls]``
``speed_mps``          V₀, the speed of both wheels if Δv = 0, ``[*batch, 1]``
a noise                the errors of the sensors, ``[*batch, 1]``; see the classes
=====================  =====================================================================

At the start no ball is held, and the other entries have the numbers of the configuration.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from envs.core.pure import Entries
from envs.robot import balls
from envs.robot.arena import Arena
from envs.robot.follow import FollowBall
from envs.robot.follow_obstacles import FollowObstacles
from envs.robot.geometry import Boxes, Walls
from envs.robot.wander import Wander


class PlayedFollow(FollowBall):
    """The paper's task with a ball that can be taken from its circle.

    The noise is ``bearing_noise_rad``, the standard deviation of the bearing's error. The entries
    ``ball_x_m`` and ``ball_y_m``, each ``[*batch, 1]``, are the ball's place.

    Arguments: see :class:`envs.core.pure.PureEnv`.
    """

    noise = "bearing_noise_rad"
    shared = (*FollowBall.state_keys[3:], "ball_x_m", "ball_y_m", "held")
    state_keys = (*FollowBall.state_keys[:3], *shared, "speed_mps", noise)

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        state = super().initial(seed, episode, situations)
        x_m, y_m = balls.position(state["ball_angle_rad"], self.world.circle_radius_m)
        state |= {"ball_x_m": x_m, "ball_y_m": y_m, "held": torch.zeros_like(x_m)}
        dials = "speed_mps", self.noise
        return state | {key: torch.full_like(x_m, getattr(self.world, key)) for key in dials}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        stays = {key: state[key] for key in ("held", "speed_mps", self.noise)}
        return super().transition(state, action) | stays

    def _speed_mps(self, state: Entries) -> Tensor:
        return state["speed_mps"]

    def _noise_rad(self, state: Entries) -> Tensor:
        return state[self.noise]

    def _roll(self, state: Entries) -> tuple[Entries, Tensor, Tensor]:
        ball, rolled_x_m, rolled_y_m = super()._roll(state)
        held = state["held"] > 0
        x_m = torch.where(held, state["ball_x_m"], rolled_x_m)
        y_m = torch.where(held, state["ball_y_m"], rolled_y_m)
        return ball | {"ball_x_m": x_m, "ball_y_m": y_m}, x_m, y_m


class _PlayedArena(Arena):
    """A field whose balls can be held and whose drawn obstacles can be moved.

    The noise is ``noise``, a factor on the errors of all sensors.
    """

    noise = "noise"

    @property
    def shared(self) -> tuple[str, ...]:
        """The entries of the balls and the drawn obstacles."""
        return tuple(key for key in self._many if key != "sonar_m")

    @property
    def state_sizes(self) -> dict[str, int]:
        return super().state_sizes | {"speed_mps": 1, self.noise: 1}

    @property
    def _many(self) -> dict[str, int]:
        number = len(self.world.ball_entries)
        return super()._many | ({"held": number} if number else {})

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        state = super().initial(seed, episode, situations)
        if "ball_x_m" in state:
            state["held"] = torch.zeros_like(state["ball_x_m"])
        speed_mps = torch.full_like(state["x_m"], self.world.robot.speed_mps)
        return state | {"speed_mps": speed_mps, self.noise: torch.ones_like(speed_mps)}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        stays = {key: state[key] for key in ("held", "speed_mps", self.noise) if key in state}
        return super().transition(state, action) | stays

    def _speed_mps(self, before: Entries) -> Tensor:
        return before["speed_mps"]

    def _noise(self, before: Entries) -> Tensor:
        return before[self.noise]

    def _move_balls(
        self, before: Entries, walls: Walls | None, boxes: Boxes | None
    ) -> dict[str, Tensor]:
        return {
            key: torch.where(before["held"] > 0, before[key], moved)
            for key, moved in super()._move_balls(before, walls, boxes).items()
        }


class PlayedObstacles(_PlayedArena, FollowObstacles):
    """The task of catching a ball among obstacles, with objects that can be moved.

    Arguments: see :class:`envs.core.pure.PureEnv`.
    """


class PlayedWander(_PlayedArena, Wander):
    """The task of driving about, with obstacles that can be moved.

    Arguments: see :class:`envs.core.pure.PureEnv`.
    """


PLAYED: dict[str, Callable[..., PlayedFollow | PlayedObstacles | PlayedWander]] = {
    "follow_ball": PlayedFollow,
    "follow_obstacles": PlayedObstacles,
    "wander": PlayedWander,
}
"""The worlds by the kinds of their configurations; the arguments are those of PureEnv."""
