"""Single environments of another library as a world, one for each run."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.core import streams
from envs.core.pure import WHEN, Entries, PureEnv
from envs.core.streams import Stream
from envs.singles.schemas import SinglesConfig


class Moment(NamedTuple):
    """The outcome of a step, or the first observation of an episode."""

    seen: Sequence[float]
    reward: float = 0.0
    terminated: bool = False
    truncated: bool = False


class Single(ABC):
    """A single environment of another library."""

    @abstractmethod
    def reset(self, seed: int) -> Sequence[float]:
        """Begin an episode and return its first observation.

        Args:
            seed: the seed of the episode, a whole number below 2⁶², which alone determines its
                random numbers.
        """

    @abstractmethod
    def step(self, action: float) -> Moment:
        """Take a step.

        Args:
            action: a number in the range of actions, or the index of an action.
        """


class _Lane:
    """The environment of one run, with the episode and the actions that it has played."""

    def __init__(self, single: Single) -> None:
        self._single = single
        self._episode: tuple[int, int] | None = None
        self._actions: list[float] = []
        self._moment = Moment(())

    def play(self, episode: tuple[int, int], seed: int, actions: list[float]) -> Moment:
        """Return the outcome of an episode's last action.

        If the environment has already played a first part of these actions, only the rest is
        played; otherwise the episode is played from its start.

        Args:
            episode: the run's seed and the episode's number.
            seed: the seed of this episode.
            actions: all actions of the episode so far.
        """
        if self._episode != episode or self._actions != actions[: len(self._actions)]:
            self._episode, self._actions = episode, []
            self._moment = Moment(self._single.reset(seed))
        for action in actions[len(self._actions) :]:
            if not (self._moment.terminated or self._moment.truncated):
                self._moment = self._single.step(action)
            self._actions.append(action)
        return self._moment


class SinglesWorld(PureEnv):
    """A batch of single environments. A subclass makes them (:meth:`make_single`).

    The state is the seed, the episode and ``history``, the actions so far. An environment that has
    played other actions, as after an interruption, plays the episode again from its start. So a run
    doesn't depend on its batch if the environment's only source of randomness is its seed.

    Arguments: see :class:`envs.core.pure.PureEnv`.
    """

    state_keys = ("history",)
    world: SinglesConfig

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._lanes: dict[int, _Lane] = {}

    @abstractmethod
    def make_single(self) -> Single:
        """Make an environment."""

    @property
    def state_sizes(self) -> dict[str, int]:
        """The size of ``history``: one place for each action of an episode."""
        return {"history": self.world.time_limit_steps}

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        history = seed.new_zeros((*seed.shape[:-1], self.world.time_limit_steps), dtype=self.dtype)
        moments = self._play(seed, episode, torch.zeros_like(episode), history)
        return {**self._seen(moments, seed), "history": history}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        seed, episode, step = (state[key] for key in WHEN)
        place = (step - 1).clamp(0, self.world.time_limit_steps - 1)
        history = state["history"].scatter(-1, place, action.to(self.dtype))
        moments = self._play(seed, episode, step, history)
        rewards, ends, cuts = (
            torch.tensor([getattr(moment, name) for moment in moments], device=seed.device)
            for name in ("reward", "terminated", "truncated")
        )
        return {
            **self._seen(moments, seed),
            "history": history,
            "reward": rewards.to(self.dtype).view(seed.shape),
            "terminated": ends.view(seed.shape),
            "truncated": cuts.view(seed.shape),
        }

    def restart(self, after: TensorDictBase) -> TensorDict:
        """Return the state before the next step; only environments that are done are reset."""
        done = after["done"]
        kept = {key: after[key] for key in (*self._kept, "chance", *WHEN)}
        if done.any():
            kept["episode"] = kept["episode"] + done
            kept["step"] = kept["step"].masked_fill(done, 0)
            kept["history"] = kept["history"].masked_fill(done, 0)
            seed, episode, step = (kept[key] for key in WHEN)
            kept |= self._seen(self._play(seed, episode, step, kept["history"]), done)
            words = streams.draw(seed, episode, step, Stream.CHANCE)
            fresh = streams.uniform(words[0], self.dtype)
            kept["chance"] = torch.where(done, fresh, kept["chance"])
        return self.pack(kept)

    def _play(self, seed: Tensor, episode: Tensor, step: Tensor, history: Tensor) -> list[Moment]:
        """Return the outcome in every environment; equal episodes, as in idle lanes, play once."""
        words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        high, low = (word.to(torch.int64) & 0x7FFFFFFF for word in words[:2])
        seeds = (high << 31) | low
        found: dict[Any, Moment] = {}
        moments = []
        numbers = (x.flatten().tolist() for x in (seed, episode, step, seeds))
        rows = history.flatten(0, -2).cpu() if history.ndim > 1 else history.unsqueeze(0).cpu()
        for lane, (run, number, steps, own) in enumerate(zip(*numbers, strict=True)):
            actions = rows[lane, :steps].tolist()
            key = (run, number, tuple(actions))
            if key not in found:
                if lane not in self._lanes:
                    self._lanes[lane] = _Lane(self.make_single())
                found[key] = self._lanes[lane].play((run, number), own, actions)
            moments.append(found[key])
        return moments

    def _seen(self, moments: list[Moment], like: Tensor) -> Entries:
        rows = np.array([moment.seen for moment in moments], dtype=np.float64)
        columns = torch.from_numpy(rows).to(like.device, self.dtype).unbind(-1)
        return {
            key: column.view(like.shape) for key, column in zip(self.seen, columns, strict=True)
        }
