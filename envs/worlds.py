"""The registry of the worlds by kind; :mod:`envs.schemas` has their schemas."""

from typing import Any

from envs.classic.acrobot import Acrobot
from envs.classic.cart_pole import CartPole
from envs.classic.chain import Chain
from envs.classic.mountain_car import MountainCar
from envs.classic.random_walk import RandomWalk
from envs.classic.ring import Ring
from envs.classic.two_states import TwoStates
from envs.core.pure import PureEnv
from envs.core.registry import class_of
from envs.core.world import WorldConfig
from envs.from_gymnasium.world import GymnasiumWorld
from envs.from_torchrl.world import TorchRLWorld
from envs.robot.follow import FollowBall
from envs.robot.follow_obstacles import FollowObstacles
from envs.robot.one_side import FollowOneSide
from envs.robot.wander import Wander

WORLDS: dict[str, type[PureEnv]] = {
    "acrobot": Acrobot,
    "cart_pole": CartPole,
    "chain": Chain,
    "follow_ball": FollowBall,
    "follow_obstacles": FollowObstacles,
    "follow_one_side": FollowOneSide,
    "gymnasium": GymnasiumWorld,
    "mountain_car": MountainCar,
    "random_walk": RandomWalk,
    "ring": Ring,
    "two_states": TwoStates,
    "wander": Wander,
}

ADAPTERS: dict[str, type[PureEnv]] = {"torchrl": TorchRLWorld}
"""The worlds made from the classes of other libraries; the kind is ``adapter:module:Class``."""


def make_world(config: WorldConfig, *args: Any, **settings: Any) -> PureEnv:
    """Make the environment that a configuration describes.

    Args:
        config: the configuration of one of `WORLDS`, of a user's world (``module:Class``) or of
            another library's (``adapter:module:Class``).
        args, settings: further arguments of :class:`envs.core.pure.PureEnv`.

    Raises:
        ConfigError: if the user's class can't be imported or isn't a `PureEnv`.
    """
    return class_of("env.kind", config.kind, WORLDS | ADAPTERS, PureEnv)(config, *args, **settings)
