"""The pictures of all worlds that have one, by world.

The worlds don't import this module, so that only programs that draw load Matplotlib.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from tensordict import TensorDictBase

from envs.canvas import Shot
from envs.classic import drawing as classic
from envs.classic.acrobot import Acrobot
from envs.classic.cart_pole import CartPole
from envs.classic.chain import Chain
from envs.classic.mountain_car import MountainCar
from envs.classic.random_walk import RandomWalk
from envs.core.parameters import ConfigError
from envs.core.pure import PureEnv
from envs.robot import drawing as robot
from envs.robot.arena import Arena
from envs.robot.follow import FollowBall

_SHOTS: dict[type[Any], Callable[[Any, TensorDictBase], Shot]] = {
    Acrobot: classic.of_acrobot,
    Arena: robot.of_arena,
    CartPole: classic.of_pole,
    Chain: classic.of_chain,
    FollowBall: robot.of_ball,
    MountainCar: classic.of_car,
    RandomWalk: classic.of_walk,
}
"""The function that makes a shot of a world's state, by the world or its base class."""


def shot_of(env: PureEnv, state: TensorDictBase, run: int = 0) -> Shot:
    """Return the visible state of one run of a batch.

    Args:
        env: a world that has pictures.
        state: the state of the whole batch after a reset or a step.
        run: the run's index in the flattened batch.

    Raises:
        ConfigError: if the world has no pictures.
    """
    one = state.reshape(-1)[run : run + 1]
    for world, shot in _SHOTS.items():
        if isinstance(env, world):
            return replace(
                shot(env, one),
                step=int(one["step"]),
                reward=float(one.get("reward", 0.0)),
                ended=bool(one.get("done", False)),
                success=bool(one.get("success", False)),
            )
    raise ConfigError(
        f"{type(env).__name__} has no picture; env.kind={env.world.kind} can't be drawn"
    )
