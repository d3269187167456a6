"""The registries of the worlds' schemas by kind, without torch."""

from envs.classic.schemas import (
    AcrobotConfig,
    CartPoleConfig,
    ChainConfig,
    MountainCarConfig,
    RandomWalkConfig,
    RingConfig,
    TwoStatesConfig,
)
from envs.core.world import WorldConfig
from envs.from_gymnasium.schemas import GymnasiumConfig
from envs.from_torchrl.schemas import TorchRLConfig
from envs.robot.schemas import (
    FollowBallConfig,
    FollowObstaclesConfig,
    FollowOneSideConfig,
    WanderConfig,
)

SCHEMAS: dict[str, type[WorldConfig]] = {
    "acrobot": AcrobotConfig,
    "cart_pole": CartPoleConfig,
    "chain": ChainConfig,
    "follow_ball": FollowBallConfig,
    "follow_obstacles": FollowObstaclesConfig,
    "follow_one_side": FollowOneSideConfig,
    "gymnasium": GymnasiumConfig,
    "mountain_car": MountainCarConfig,
    "random_walk": RandomWalkConfig,
    "ring": RingConfig,
    "two_states": TwoStatesConfig,
    "wander": WanderConfig,
}

ADAPTERS: dict[str, type[WorldConfig]] = {"torchrl": TorchRLConfig}
"""The schemas for the classes of other libraries; the kind is ``adapter:module:Class``."""
