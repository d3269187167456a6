"""Environments whose step is a pure function of the TensorDict."""

from abc import abstractmethod
from collections.abc import Sequence
from math import inf
from typing import Any, ClassVar

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, TensorSpec, Unbounded
from torchrl.envs import EnvBase

from envs.core import streams
from envs.core.streams import Stream
from envs.core.world import WorldConfig

WHEN = "seed", "episode", "step"
"""The entries that key the random numbers: int64, ``[*batch_size, 1]``."""

_DRAWN_SEEDS = 2**62
"""An unseeded world draws one seed below this number; run i has that seed + i."""

Entries = dict[str, Tensor]


class PureEnv(EnvBase):
    """A batch of independent runs, with all of their state in the TensorDict.

    Random numbers depend on the run's ``seed``, ``episode`` and ``step`` alone
    (:mod:`envs.core.streams`). So a run's history doesn't depend on the batch that it is in, and a
    loop of steps compiles.

    A subclass has a ``schema``, lists its hidden state in ``state_keys``, and has two pure
    functions, :meth:`initial` and :meth:`transition`. This class does the rest: specs, seeds,
    resets, the count of steps, the time limit. Entries of the TensorDicts, each
    ``[*batch_size, 1]``:

    ============================  ================================================================
    the observations, the state   real
    ``chance``                    U[0, 1), for the choice of the action
    ``action``                    real: in the world's range, or the index of one of its actions
    ``reward``                    real
    ``terminated``                the task has ended the episode
    ``truncated``                 the time limit has ended the episode
    ``done``                      either of them
    ``success``                   the episode has ended with a success
    ``seed``, ``episode``,        the key of the random numbers (int64)
    ``step``
    ============================  ================================================================

    TorchRL's ``reset`` counts the episodes in the environment. :meth:`restart` counts them in the
    TensorDict, so it compiles.

    Args:
        world: the parameters, an instance of ``schema``.
        batch_size: the shape of the batch of runs; ``()`` is a single one.
        situations: fixed starts, of a shape that broadcasts to ``[*batch_size, values]``
            (:attr:`envs.core.world.WorldConfig.start_values`); random ones by default.
        seed: an integer (run i of the batch gets ``seed + i``) or the seeds themselves, int64 of
            shape ``batch_size``. By default a random integer from torch's default generator, so
            worlds differ from each other, and ``torch.manual_seed`` repeats them.
        dtype: of all real entries.
        device: of all entries.

    Attributes:
        seen: the names of the observations.
    """

    schema: ClassVar[type[WorldConfig]]
    state_keys: ClassVar[tuple[str, ...]] = ()
    """The names of the hidden state, real entries that one step hands to the next."""

    situations: Tensor | None
    _seed: Tensor
    _episode: Tensor

    def __init__(
        self,
        world: WorldConfig,
        batch_size: Sequence[int] = (),
        *,
        situations: Tensor | None = None,
        seed: int | Tensor | None = None,
        dtype: torch.dtype = torch.float32,
        device: torch.device | str | None = None,
    ) -> None:
        super().__init__(device=device, batch_size=torch.Size(batch_size))
        self.world = world
        self.dtype = dtype
        if situations is not None:
            values = len(world.start_values)
            situations = situations.to(device, dtype).expand(*self.batch_size, values).clone()
        self.register_buffer("situations", situations)
        self.seed_runs(int(torch.randint(_DRAWN_SEEDS, ())) if seed is None else seed)
        self._make_specs()

    @abstractmethod
    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        """Return the observations and the state at the start of an episode.

        Args:
            seed, episode: int64 ``[*batch_size, 1]``, for :func:`envs.core.streams.draw` with step
                0 and ``Stream.START``.
            situations: fixed starts, ``[*batch_size, values]``; None for random ones.

        Returns:
            Each ``[*batch_size, 1]``. A world with random bits to spare may add a ``chance``; else
            one is drawn.
        """

    @abstractmethod
    def transition(self, state: Entries, action: Tensor) -> Entries:
        """Return the observations and the state after a step, and its reward and end.

        Args:
            state: the observations and the state before it, and ``seed``, ``episode`` and ``step``,
                the number of this step from 1, for :func:`envs.core.streams.draw` with
                ``Stream.STEP``.
            action: ``[*batch_size, 1]``.

        Returns:
            The new observations and state, ``reward`` and ``terminated`` (bool). It may add
            ``success`` (bool), for an episode that ends here, and ``chance``.
        """

    def start(self, seed: Tensor, episode: Tensor, situations: Tensor | None = None) -> TensorDict:
        """Return the first state of an episode.

        Args:
            seed, episode: int64 ``[*batch_size, 1]``.
            situations: starts, ``[*batch_size, values]``, instead of the environment's own.
        """
        situations = self.situations if situations is None else situations
        entries = self.initial(seed, episode, situations)
        entries |= {"seed": seed, "episode": episode, "step": torch.zeros_like(episode)}
        return self.pack(self._with_chance(entries))

    def restart(self, after: TensorDictBase) -> TensorDict:
        """Return the state for the next step: where ``done``, the start of the run's next episode.

        Args:
            after: the ``"next"`` of a step.
        """
        start = self.start(after["seed"], after["episode"] + 1)
        done = after["done"]
        return self.pack({key: torch.where(done, new, after[key]) for key, new in start.items()})

    def pack(self, entries: Entries) -> TensorDict:
        """Return a TensorDict of this environment's batch."""
        return TensorDict(entries, batch_size=self.batch_size, device=self.device)

    def seed_runs(self, seed: int | Tensor) -> None:
        """Give every run its seed; the next reset begins its first episode.

        Args:
            seed: an integer (run i gets ``seed + i``) or int64 of shape ``batch_size``.
        """
        if not isinstance(seed, Tensor):
            seed = seed + torch.arange(self.batch_size.numel())
        seed = seed.to(self.device, torch.int64).reshape(*self.batch_size, 1).clone()
        # As buffers they go along with the environment to another device and into its state_dict.
        self.register_buffer("_seed", seed)
        self.register_buffer("_episode", torch.full_like(seed, -1))

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        state = {key: tensordict[key] for key in (*self._kept, *WHEN)}
        state["step"] = state["step"] + 1
        after = self.transition(state, tensordict["action"])
        after |= {key: state[key] for key in WHEN}
        never = torch.zeros_like(after["terminated"])
        late = after["step"] >= self.world.time_limit_steps
        after["truncated"] = late & ~after["terminated"]
        after["done"] = after["terminated"] | after["truncated"]
        after["success"] = after.get("success", never)
        return self.pack(self._with_chance(after))

    def _with_chance(self, entries: Entries) -> Entries:
        if "chance" not in entries:
            seed, episode, step = (entries[key] for key in WHEN)
            words = streams.draw(seed, episode, step, Stream.CHANCE)
            entries["chance"] = streams.uniform(words[0], self.dtype)
        return entries

    def _set_seed(self, seed: int | None) -> None:
        if seed is not None:
            self.seed_runs(seed)

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDict:
        due = None if tensordict is None else tensordict.get("_reset", None)
        self._episode = self._episode + (1 if due is None else due.view_as(self._episode))
        state = self.start(self._seed.clone(), self._episode.clone())
        return state.set("success", torch.zeros_like(self._seed, dtype=torch.bool))

    def _make_specs(self) -> None:
        shape = (*self.batch_size, 1)
        real = {"shape": shape, "dtype": self.dtype, "device": self.device}

        def composite(**entries: TensorSpec) -> Composite:
            return Composite(entries, shape=self.batch_size, device=self.device)

        def flag() -> Binary:
            return Binary(1, shape, dtype=torch.bool, device=self.device)

        seen = {key: _spec(*span, **real) for key, span in self.world.observations.items()}
        self.seen = [*seen]
        self._kept = [*seen, *(key for key in self.state_keys if key not in seen)]
        state = {key: Unbounded(**real) for key in self._kept}
        state |= {key: Unbounded(shape, dtype=torch.int64, device=self.device) for key in WHEN}
        self.state_spec = composite(**state)
        seen |= {"chance": Bounded(0, 1, **real), "success": flag()}
        self.observation_spec = composite(**(state | seen)).clone()
        actions = self.world.actions
        self.action_spec = (
            Categorical(actions, **real) if isinstance(actions, int) else _spec(*actions, **real)
        )
        self.reward_spec = Unbounded(**real)
        self.done_spec = composite(done=flag(), terminated=flag(), truncated=flag())


def _spec(low: float, high: float, **real: Any) -> TensorSpec:
    if (low, high) == (-inf, inf):
        return Unbounded(**real)
    return Bounded(low, high, **real)
