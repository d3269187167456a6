"""Adapters that present the worlds of ``envs`` as Gymnasium environments."""

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
"""The exclusive upper bounds of seeds and episodes (:func:`envs.core.streams.draw`)."""


class GymWorld(gymnasium.Env[NDArray[np.float32], np.int64]):
    """A Gymnasium environment of a single run of one of our worlds.

    * Observations: the world's observations, in the order of its configuration (float32).
    * Actions: the index of an action in the world's fixed set, or of a candidate in its range.
    * ``info["is_success"]``: whether the episode has ended with a success.
    * ``render()``: with ``render_mode="rgb_array"``, a picture of the world, if it has one.

    A run's random numbers come from its seed (:mod:`envs.core.streams`), not from ``np_random``.
    The same seed and episode number give the same episode here as in any batch.

    Attributes:
        world: the underlying TorchRL environment.

    Args:
        config: the world's parameters (``conf/env/follow_ball.yaml``: the paper's task).
        candidates: the number of evenly spaced actions in the world's range, at least 2
            (``conf/action/even.yaml``); ignored if the world has a fixed set of actions.
        render_mode: ``rgb_array``, or None for no pictures.

    Raises:
        OutOfRange: if ``render_mode`` is unknown, or if the world has a range of actions and
            ``candidates`` isn't allowed.
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
        # The seed isn't used: `start` gets the real seed each time.
        self.world = make_world(config, seed=0, dtype=torch.float32)
        self._seed: int | None = None
        self._episode = -1
        self._state: TensorDictBase | None = None
        self._shown: TensorDictBase | None = None  # the state to render, also after the end

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start the next episode, or the episode that ``options`` names.

        Args:
            seed: the run's seed, in [0, 2⁶³); a given seed starts a run at episode 0. If no seed
                was ever given, it is drawn from ``np_random``, as usual in Gymnasium.
            options: ``episode``, the number of the episode within the run, in [0, 2³³);
                ``start``, the numbers of a fixed start, which replaces the random start.

        Returns:
            The observation and ``info``.

        Raises:
            OutOfRange: if the seed or an option's value isn't allowed, or an option is unknown.
        """
        options = dict(options or {})
        episode, start = options.pop("episode", None), options.pop("start", None)
        for name in options:
            raise OutOfRange("options", name, "episode or start")
        begins = None if start is None else torch.tensor(self._start(start), dtype=torch.float32)
        run = None if seed is None else _whole("seed", seed, 0, _SEEDS)
        if episode is None:
            episode = self._episode + 1 if seed is None else 0
        episode = _whole("episode", episode, 0, _EPISODES)
        super().reset(seed=run)
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
            gymnasium.error.ResetNeeded: if no episode has begun or the episode has ended.
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
        """Return a picture of the world, uint8 ``[height, width, 3]``, or None without a mode.

        Raises:
            gymnasium.error.ResetNeeded: if no episode has begun.
            TypeError: if the world has no pictures.
        """
        if self.render_mode is None:
            return None
        if self._shown is None:
            raise ResetNeeded("no situation has begun: call reset first")
        from envs.canvas import Canvas  # loads Matplotlib
        from envs.drawing import shot_of

        return Canvas().draw([[shot_of(self.world, self._shown)]])

    def _see(self, state: TensorDictBase) -> NDArray[np.float32]:
        seen: NDArray[np.float32] = torch.cat([state[key] for key in self.world.seen], -1).numpy()
        return seen

    def _start(self, start: Any) -> list[float]:
        """Return a start as floats; raise OutOfRange for a wrong length or an infinite number."""
        values = self.world.world.start_values
        try:
            numbers = [*map(float, start)]
        except (TypeError, ValueError):
            numbers = []
        if len(numbers) != len(values) or not all(map(isfinite, numbers)):
            raise OutOfRange("start", start, f"finite numbers [{', '.join(values)}]")
        return numbers


class GymWorlds(gymnasium.vector.VectorEnv[NDArray[np.float32], NDArray[np.int64], Any]):
    """A Gymnasium vector environment: several runs of one of our worlds, each with its own seed.

    One call of the world steps all members. After a member's episode has ended, its next step
    ignores the action and begins the next episode (``AutoresetMode.NEXT_STEP``).

    Args:
        num_envs: the number of members.
        config, candidates: as for `GymWorld`.
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
        self.world = make_world(config, [self.num_envs], dtype=torch.float32)
        self._state: TensorDictBase | None = None

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start the next episode of every member.

        Args:
            seed: member i starts the run with the seed ``seed + i`` at episode 0.
            options: ignored.

        Returns:
            The observations ``[num_envs, observations]`` and ``info``.

        Raises:
            OutOfRange: if the seed isn't allowed.
        """
        first = None if seed is None else _whole("seed", seed, 0, _SEEDS - self.num_envs)
        super().reset(seed=first)
        if first is not None:
            self.world.seed_runs(first)
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
        """Take a step of every member, or begin its next episode.

        Raises:
            OutOfRange: if there is no such action.
            gymnasium.error.ResetNeeded: if no episode has begun.
        """
        if not self.action_space.contains(actions):
            end = self._candidates.numel()
            raise OutOfRange("actions", actions, f"whole numbers in [0, {end}), one per member")
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
    """Return the fixed set of actions, or evenly spaced actions over the range."""
    actions = config.actions
    if isinstance(actions, int):
        return torch.arange(actions, dtype=torch.float32)
    return torch.linspace(*actions, _whole("candidates", number, 2, 2**31), dtype=torch.float32)


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
