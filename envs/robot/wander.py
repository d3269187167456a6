"""The robot drives about without touching anything."""

from envs.core.pure import Entries
from envs.robot.arena import Arena, Moved
from envs.robot.schemas import WanderConfig


class Wander(Arena):
    """The task of driving on, as straight as possible, without touching anything.

    A situation ends with a collision. At the time limit it is cut off and counts as a success.

    Arguments and entries: those of :class:`envs.robot.arena.Arena`.
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
