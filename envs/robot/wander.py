"""The robot drives about and touches nothing."""

from envs.core.pure import Entries
from envs.robot.arena import Arena, Moved
from envs.robot.schemas import WanderConfig


class Wander(Arena):
    """Drive on, as straight as can be, and touch nothing.

    A situation ends by a collision. At the time limit it is cut off, which is a success.

    Arguments and entries: as :class:`envs.robot.arena.Arena`.
    """

    schema = WanderConfig
    world: WanderConfig

    def judge(self, moved: Moved) -> Entries:
        world = self.world
        reward = world.step_reward - world.steering_cost * moved.action.abs()
        late = moved.step >= world.time_limit_steps
        return {
            "reward": reward.masked_fill(moved.collided, world.collision_reward),
            "terminated": moved.collided,
            "success": late & ~moved.collided,
        }
