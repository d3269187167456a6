"""The simulated worlds. They know nothing of learning.

The public names are loaded when they are first used, so that a world's parameters
(:mod:`envs.core.parameters`) can be checked without importing torch.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "ConfigError": "core.parameters",
    "FollowBall": "robot.follow",
    "FollowObstacles": "robot.follow_obstacles",
    "FollowOneSide": "robot.one_side",
    "Pixels": "pixels",
    "PureEnv": "core.pure",
    "Stream": "core.streams",
    "Wander": "robot.wander",
    "WorldConfig": "core.world",
    "check_world": "core.contract",
    "draw": "core.streams",
    "flag": "core.parameters",
    "make_world": "worlds",
    "normal": "core.streams",
    "number": "core.parameters",
    "one_of": "core.parameters",
    "texts": "core.parameters",
    "uniform": "core.streams",
    "whole": "core.parameters",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
