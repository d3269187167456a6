"""The paper's task with a ball that can be taken from its circle and held anywhere."""

import torch
from torch import Tensor

from envs.core.pure import Entries
from envs.robot import balls
from envs.robot.follow import FollowBall


class HeldBall(FollowBall):
    """A :class:`envs.robot.follow.FollowBall` whose ball rolls on its circle unless it is held.

    The additional entries, each ``[*batch_size, 1]``, are ``ball_x_m`` and ``ball_y_m``, the ball's
    place, and ``held``. If ``held`` is above 0, a step doesn't move the ball; the caller moves it
    by writing a new place between the steps. At the start no ball is held.

    Arguments: see :class:`envs.core.pure.PureEnv`.
    """

    state_keys = (*FollowBall.state_keys, "ball_x_m", "ball_y_m", "held")

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        state = super().initial(seed, episode, situations)
        x_m, y_m = balls.position(state["ball_angle_rad"], self.world.circle_radius_m)
        return state | {"ball_x_m": x_m, "ball_y_m": y_m, "held": torch.zeros_like(x_m)}

    def _roll(self, state: Entries) -> tuple[Entries, Tensor, Tensor]:
        ball, rolled_x_m, rolled_y_m = super()._roll(state)
        held = state["held"] > 0
        x_m = torch.where(held, state["ball_x_m"], rolled_x_m)
        y_m = torch.where(held, state["ball_y_m"], rolled_y_m)
        return ball | {"ball_x_m": x_m, "ball_y_m": y_m, "held": state["held"]}, x_m, y_m
