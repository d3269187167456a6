"""The follow-the-ball world behind Gymnasium's interface, for learners that ask for it."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, nan
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray
from tensordict import TensorDictBase

from envs.core.parameters import OutOfRange
from envs.robot.follow import FollowBall
from envs.robot.schemas import World

_SEEDS, _EPISODES = 2**63, 2**33
"""How many there are (:func:`envs.core.streams.draw`)."""


class FollowBallGym(gymnasium.Env[NDArray[np.float32], np.int64]):
    """One robot of :class:`envs.robot.follow.FollowBall`, which does all the arithmetic.

    * Observations: Δθ, the ball's bearing as seen, rad, ``[1]`` (float32).
    * Actions: the index of a candidate Δv, evenly spaced in [−1, 1].
    * Both ends of a situation, catch and miss, are ``terminated``; nothing is ``truncated``.
    * ``info["is_success"]``: whether the situation has ended in a catch.

    Random numbers are the run's own (:mod:`envs.core.streams`), not those of ``np_random``: a seed
    and an episode's number have the same situation here as in any batch.

    Attributes:
        world: the environment behind it.

    Args:
        world: the physical parameters (``conf/env/follow_ball.yaml`` has the paper's).
        candidates: how many there are (``conf/action/even.yaml``), at least 2.

    Raises:
        OutOfRange: there are fewer.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # as Gymnasium declares it

    def __init__(self, world: World, candidates: int) -> None:
        candidates = _whole("candidates", candidates, 2, 2**31)
        view = world.field_of_view_rad
        self.observation_space = Box(-view, view, (1,), np.float32)
        self.action_space = Discrete(candidates)
        self._candidates = torch.linspace(-1, 1, candidates)
        self.world = FollowBall(world)
        self._seed, self._episode = 0, -1
        self._state: TensorDictBase | None = None

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """The next situation, or one that is asked for.

        Args:
            seed: of the run, in [0, 2⁶³), which begins anew with its episode 0. Before the first
                seed it is 0.
            options: ``episode``, the number of the situation within the run, in [0, 2³³);
                ``start``, where the ball is and how it rolls, (φ₀, ω_b) in rad and rad/s, instead
                of at random.

        Returns:
            The observation and ``info``.

        Raises:
            OutOfRange: a seed or an option isn't allowed, or there is no such option.
        """
        options = dict(options or {})
        episode, start = options.pop("episode", None), options.pop("start", None)
        for name in options:
            raise OutOfRange("options", name, "episode or start")
        begins = None if start is None else torch.tensor(_pair("start", start))
        run = self._seed if seed is None else _whole("seed", seed, 0, _SEEDS)
        if episode is None:
            episode = self._episode + 1 if seed is None else 0
        episode = _whole("episode", episode, 0, _EPISODES)
        super().reset(seed=seed)
        self._seed, self._episode = run, episode
        self._state = self.world.start(torch.tensor([run]), torch.tensor([episode]), begins)
        return self._see(self._state), {"is_success": False}

    def step(
        self, action: np.int64 | int
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """One step of the world.

        Args:
            action: the index of a candidate.

        Returns:
            The observation, the reward, ``terminated``, ``truncated`` (never) and ``info``.

        Raises:
            OutOfRange: there is no such action.
            gymnasium.error.ResetNeeded: no situation has begun, or it has ended.
        """
        if not self.action_space.contains(action):
            end = self._candidates.numel()
            raise OutOfRange("action", action, f"a whole number in [0, {end})")
        if self._state is None:
            raise ResetNeeded("no situation has begun, or it has ended: call reset first")
        after = self.world.step(self._state.set("action", self._candidates[action].view(1)))
        after = after["next"]
        ended, reward = bool(after["terminated"]), float(after["reward"])
        self._state = None if ended else after
        return self._see(after), reward, ended, False, {"is_success": ended and reward > 0}

    def _see(self, state: TensorDictBase) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = state["bearing"].numpy()
        return seen


def _whole(name: str, value: Any, low: int, end: int) -> int:
    """The value, if it is a whole number from low to before the end."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (whole and low <= value < end):
        raise OutOfRange(name, value, f"a whole number in [{low}, {end})")
    return int(value)


def _pair(name: str, value: Any) -> list[float]:
    """The value, if it is two finite numbers."""
    try:
        first, second = map(float, value)
    except (TypeError, ValueError):
        first = second = nan
    if not (isfinite(first) and isfinite(second)):
        raise OutOfRange(name, value, "two finite numbers, φ₀ in rad and ω_b in rad/s")
    return [first, second]
