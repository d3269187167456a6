"""Any Gymnasium environment as a world, one environment for each run."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from envs.from_gymnasium.schemas import GymnasiumConfig, make
from envs.singles.world import Moment, Single, SinglesWorld

if TYPE_CHECKING:
    import gymnasium


class _GymnasiumSingle(Single):
    """An environment of Gymnasium's registry."""

    def __init__(self, world: GymnasiumConfig) -> None:
        limit = world.time_limit_steps
        self._env: gymnasium.Env[Any, Any] = make(world.id, max_episode_steps=limit)
        # The number of the first action of a fixed set; None for a range of actions.
        first = getattr(self._env.action_space, "start", None)
        self._first = None if first is None else int(first)

    def reset(self, seed: int) -> Sequence[float]:
        return _row(self._env.reset(seed=seed)[0])

    def step(self, action: float) -> Moment:
        given = (
            np.array([action], dtype=self._env.action_space.dtype)
            if self._first is None
            else self._first + int(action)
        )
        seen, reward, terminated, truncated, _ = self._env.step(given)
        return Moment(_row(seen), float(reward), bool(terminated), bool(truncated))


class GymnasiumWorld(SinglesWorld):
    """A batch of environments of Gymnasium's registry.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/gymnasium.yaml``.
    """

    schema = GymnasiumConfig
    world: GymnasiumConfig

    def make_single(self) -> Single:
        return _GymnasiumSingle(self.world)


def _row(seen: Any) -> Sequence[float]:
    row: list[float] = np.ravel(seen).tolist()
    return row
