"""An adapter from the worlds of ``envs`` to Gymnasium's interface."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Discrete, Space
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from tensordict import TensorDictBase

from envs.core.parameters import OutOfRange
from envs.core.world import WorldConfig
from envs.worlds import make_world

_SEEDS, _EPISODES = 2**63, 2**33
"""The upper bounds, exclusive, of seeds and of episodes (:func:`envs.core.streams.draw`)."""


class GymWorld(gymnasium.Env[NDArray[np.float32], np.int64]):
    """A Gymnasium environment: a single run of one of the worlds of ``envs``.

    * Observations: the world's, in the order of its configuration (float32).
    * Actions: the index of an action in the world's fixed set, or of a candidate in its range.
    * ``info["is_success"]``: whether the episode has ended with a success.

    A run's random numbers come from its seed (:mod:`envs.core.streams`), not from ``np_random``.
    The same seed and episode number give the same episode here as in any batch.

    * ``render()``: with ``render_mode="rgb_array"``, the robot's worlds from above.

    Attributes:
        world: the underlying TorchRL environment.

    Args:
        config: the world's parameters (``conf/env/follow_ball.yaml`` has the paper's).
        candidates: the number of evenly spaced actions in the world's range, at least 2
            (``conf/action/even.yaml``); ignored if the world has a fixed set of actions.
        render_mode: ``rgb_array``, or None.

    Raises:
        OutOfRange: if the world has a range of actions and ``candidates`` isn't allowed, or if
            there is no such mode.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # as Gymnasium declares it
        "render_modes": ["rgb_array"],
        "render_fps": 10,
    }

    def __init__(
        self,
        config: WorldConfig,
        candidates: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise OutOfRange("render_mode", render_mode, "rgb_array or None")
        self.render_mode = render_mode
        self._candidates = _candidates(config, candidates)
        self.observation_space = _observation_space(config)
        self.action_space = Discrete(self._candidates.numel())
        self.world = make_world(config, seed=0)  # `start` is given the seed every time
        self._seed: int | None = None
        self._episode = -1
        self._state: TensorDictBase | None = None
        self._shown: TensorDictBase | None = None  # the end of a situation can be seen, too

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start the next episode, or a given one.

        Args:
            seed: the run's seed, in [0, 2⁶³); with it, the run starts over at episode 0. If no
                seed was ever given, one is drawn from ``np_random``, as usual in Gymnasium.
            options: ``episode``, the number of the episode within the run, in [0, 2³³);
                ``start``, the numbers of a fixed start, instead of a random one.

        Returns:
            The observation and ``info``.

        Raises:
            OutOfRange: if the seed or an option's value isn't allowed, or an option is unknown.
        """
        options = dict(options or {})
        episode, start = options.pop("episode", None), options.pop("start", None)
        for name in options:
            raise OutOfRange("options", name, "episode or start")
        begins = None if start is None else torch.tensor(self._start(start))
        run = None if seed is None else _whole("seed", seed, 0, _SEEDS)
        if episode is None:
            episode = self._episode + 1 if seed is None else 0
        episode = _whole("episode", episode, 0, _EPISODES)
        super().reset(seed=seed)
        if run is not None:
            self._seed = run
        elif self._seed is None:
            self._seed = int(self.np_random.integers(_SEEDS))
        self._episode = episode
        self._state = self.world.start(torch.tensor([self._seed]), torch.tensor([episode]), begins)
        self._shown = self._state
        return self._see(self._state), {"is_success": False}

    def step(
        self, action: np.int64 | int
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Take one step of the world.

        Args:
            action: the index of a candidate.

        Returns:
            The observation, the reward, ``terminated``, ``truncated`` and ``info``.

        Raises:
            OutOfRange: if there is no such action.
            gymnasium.error.ResetNeeded: if no episode has begun, or it has ended.
        """
        if not self.action_space.contains(action):
            end = self._candidates.numel()
            raise OutOfRange("action", action, f"a whole number in [0, {end})")
        if self._state is None:
            raise ResetNeeded("no episode has begun, or it has ended: call reset first")
        after = self.world.step(self._state.set("action", self._candidates[action].view(1)))
        after = after["next"]
        self._state = None if after["done"] else after
        self._shown = after
        return (
            self._see(after),
            float(after["reward"]),
            bool(after["terminated"]),
            bool(after["truncated"]),
            {"is_success": bool(after["success"])},
        )

    def render(self) -> NDArray[np.uint8] | None:
        """The picture of the world as it is, ``[height, width, 3]``, if there is to be any.

        Raises:
            gymnasium.error.ResetNeeded: no situation has begun.
            TypeError: the world is none of the robot's.
        """
        if self.render_mode is None:
            return None
        if self._shown is None:
            raise ResetNeeded("no situation has begun: call reset first")
        from envs.robot.drawing import Canvas, shot_of  # who draws nothing loads no matplotlib

        return Canvas().draw([[shot_of(self.world, self._shown)]])

    def _see(self, state: TensorDictBase) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = torch.cat([state[key] for key in self.world.seen], -1).numpy()
        return seen

    def _start(self, start: Any) -> list[float]:
        """Return a start as floats; raise OutOfRange for a wrong length or numbers not finite."""
        values = self.world.world.start_values
        try:
            numbers = [*map(float, start)]
        except (TypeError, ValueError):
            numbers = []
        if len(numbers) != len(values) or not all(map(isfinite, numbers)):
            raise OutOfRange("start", start, f"finite numbers [{', '.join(values)}]")
        return numbers


class GymWorlds(gymnasium.vector.VectorEnv[NDArray[np.float32], NDArray[np.int64], Any]):
    """Many runs of one of our worlds side by side, each with a seed of its own.

    All members take their steps in one call of the world. One whose episode has ended begins the
    next one in the next step, whatever its action (``AutoresetMode.NEXT_STEP``).

    Args:
        num_envs: how many.
        config, candidates: as of `GymWorld`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  # as Gymnasium declares it
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(self, num_envs: int, config: WorldConfig, candidates: int | None = None) -> None:
        self.num_envs = _whole("num_envs", num_envs, 1, 2**31)
        self._candidates = _candidates(config, candidates)
        self.single_observation_space = _observation_space(config)
        self.single_action_space = Discrete(self._candidates.numel())
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.world = make_world(config, [self.num_envs])
        self._state: TensorDictBase | None = None

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """The next situation of every member.

        Args:
            seed: member i has the run with this seed + i, which begins anew.
            options: none.

        Raises:
            OutOfRange: the seed isn't allowed.
        """
        super().reset(seed=seed)
        if seed is not None:
            self.world.seed_runs(_whole("seed", seed, 0, _SEEDS - self.num_envs))
        self._state = self.world.reset()
        return self._see(self._state), {"is_success": np.zeros(self.num_envs, dtype=bool)}

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """One step of every member, or its next situation.

        Raises:
            OutOfRange: there is no such action.
            gymnasium.error.ResetNeeded: no situation has begun.
        """
        if not self.action_space.contains(actions):
            end = self._candidates.numel()
            raise OutOfRange("actions", actions, f"whole numbers in [0, {end}), one a member")
        if self._state is None:
            raise ResetNeeded("no situation has begun: call reset first")
        before = self._state
        action = self._candidates[torch.as_tensor(actions)].unsqueeze(-1)
        after = self.world.step(before.set("action", action))["next"]
        if "done" in before:
            ended = before["done"]
            fresh = self.world.restart(before)
            for key, value in after.items():
                new = fresh[key] if key in fresh.keys() else torch.zeros_like(value)  # noqa: SIM118
                after[key] = torch.where(ended, new, value)
        self._state = after
        reward, ends, cuts, success = (
            after[key].squeeze(-1).numpy()
            for key in ("reward", "terminated", "truncated", "success")
        )
        return self._see(after), reward.astype(np.float64), ends, cuts, {"is_success": success}

    def _see(self, state: TensorDictBase) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = torch.cat([state[key] for key in self.world.seen], -1).numpy()
        return seen


def _candidates(config: WorldConfig, number: int | None) -> torch.Tensor:
    """Return the actions of a fixed set, or so many of a range."""
    actions = config.actions
    if isinstance(actions, int):
        return torch.arange(actions, dtype=torch.float32)
    return torch.linspace(*actions, _whole("candidates", number, 2, 2**31))


def _observation_space(config: WorldConfig) -> Space[NDArray[np.float32]]:
    low, high = np.array([*config.observations.values()], dtype=np.float32).T
    space: Space[Any] = Box(low, high, dtype=np.float32)
    return space


def _whole(name: str, value: Any, low: int, end: int) -> int:
    """Return the value as an int; raise OutOfRange if it isn't a whole number in [low, end)."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (whole and low <= value < end):
        raise OutOfRange(name, value, f"a whole number in [{low}, {end})")
    return int(value)
