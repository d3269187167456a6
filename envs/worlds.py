"""Our worlds by their kinds; their schemas are in :mod:`envs.schemas`."""

from typing import Any

from envs.core.pure import PureEnv
from envs.core.registry import class_of
from envs.core.world import WorldConfig
from envs.robot.follow import FollowBall
from envs.robot.one_side import FollowOneSide

WORLDS: dict[str, type[PureEnv]] = {
    "follow_ball": FollowBall,
    "follow_one_side": FollowOneSide,
}


def make_world(config: WorldConfig, *args: Any, **settings: Any) -> PureEnv:
    """Make the environment that a configuration describes.

    Args:
        config: of one of `WORLDS`, or of a user's own world, whose kind is ``module:Class``.
        *args, **settings: further arguments of :class:`envs.core.pure.PureEnv`.

    Raises:
        ConfigError: the user's own class isn't a :class:`envs.core.pure.PureEnv`.
    """
    return class_of("env", config.kind, WORLDS, PureEnv)(config, *args, **settings)
