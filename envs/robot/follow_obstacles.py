"""The robot follows a ball among obstacles that it must not touch."""

import torch

from envs.core.pure import Entries
from envs.robot.arena import Arena, Moved
from envs.robot.schemas import FollowObstaclesConfig


class FollowObstacles(Arena):
    """The task of catching the ball without touching an obstacle or a wall.

    A situation ends with a catch or with a miss at the time limit. If ``robot.collision`` is
    ``end``, it also ends with a collision.

    Arguments and entries: those of :class:`envs.robot.arena.Arena`.
    """

    schema = FollowObstaclesConfig
    world: FollowObstaclesConfig

    def judge(self, moved: Moved) -> Entries:
        world = self.world
        caught = moved.ball_distance_m < world.catch_distance_m
        ended = moved.step >= world.time_limit_steps
        reward = torch.zeros_like(moved.ball_distance_m).masked_fill(ended, world.miss_reward)
        if world.robot.collision == "end":
            ended = ended | moved.collided
            reward = reward.masked_fill(moved.collided, world.collision_reward)
        return {
            "reward": reward.masked_fill(caught, world.catch_reward),
            "terminated": ended | caught,
            "success": caught,
        }
