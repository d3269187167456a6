"""The paper's task with the ball on one side, left or right, which may be switched once."""

from torch import Tensor

from envs.robot.follow import FollowBall
from envs.robot.schemas import FollowOneSideConfig


class FollowOneSide(FollowBall):
    """A :class:`envs.robot.follow.FollowBall` whose ball starts on one side of straight ahead.

    A random start on the other side is mirrored. On the other side the head sees at most the angle
    ``other_view_rad``. From the episode ``switch_side_after`` on, unless it is 0, the sides are
    switched.

    Arguments: see :class:`envs.core.pure.PureEnv`.
    """

    schema = FollowOneSideConfig
    world: FollowOneSideConfig

    def _draw_ball(
        self, u: Tensor, v: Tensor, heads: Tensor, episode: Tensor
    ) -> tuple[Tensor, Tensor]:
        angle_rad, speed_radps = super()._draw_ball(u, v, heads, episode)
        return self._side(episode) * angle_rad.abs(), speed_radps

    def _look(
        self,
        direction_rad: Tensor,
        heading_rad: Tensor | float,
        noise_rad: Tensor,
        episode: Tensor,
    ) -> Tensor:
        seen_rad = super()._look(direction_rad, heading_rad, noise_rad, episode)
        side = self._side(episode)
        return side * (side * seen_rad).clamp(min=-self.world.other_view_rad)

    def _side(self, episode: Tensor) -> Tensor | float:
        """Return the side on which the ball starts: 1 for the left, −1 for the right."""
        first = 1.0 if self.world.start_side == "left" else -1.0
        if not self.world.switch_side_after:
            return first
        switched = (episode >= self.world.switch_side_after).to(self.dtype)
        return first * (1 - 2 * switched)
