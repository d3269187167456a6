"""The registry of the worlds' schemas by kind, without torch."""

from envs.core.world import WorldConfig
from envs.robot.schemas import (
    FollowBallConfig,
    FollowObstaclesConfig,
    FollowOneSideConfig,
    WanderConfig,
)

SCHEMAS: dict[str, type[WorldConfig]] = {
    "follow_ball": FollowBallConfig,
    "follow_obstacles": FollowObstaclesConfig,
    "follow_one_side": FollowOneSideConfig,
    "wander": WanderConfig,
}
