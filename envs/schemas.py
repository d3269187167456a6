"""The schemas of our worlds by their kinds. No torch here."""

from envs.core.world import WorldConfig
from envs.robot.schemas import FollowBallConfig, FollowOneSideConfig

SCHEMAS: dict[str, type[WorldConfig]] = {
    "follow_ball": FollowBallConfig,
    "follow_one_side": FollowOneSideConfig,
}
