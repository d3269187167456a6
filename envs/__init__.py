"""The simulated worlds. They know nothing of learning.

The public names are loaded when they are first used, so that a world's parameters
(:mod:`envs.core.parameters`) can be checked without importing torch.
"""

from importlib import import_module
from typing import Any

_HOMES = {
    "FollowBall": "robot.follow",
    "FollowOneSide": "robot.one_side",
    "PureEnv": "core.pure",
    "WorldConfig": "core.world",
    "make_world": "worlds",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
