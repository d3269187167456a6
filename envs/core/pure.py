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

Entries = dict[str, Tensor]


class PureEnv(EnvBase):
    """A batch of runs that share nothing, with the whole of their state in the TensorDict.

    What is random in a step is drawn from the run's ``seed``, ``episode`` and ``step``
    (:mod:`envs.core.streams`). So a run's history doesn't depend on the batch that it is in, and a
    loop of steps compiles.

    A subclass has a ``schema``, names the state that it carries in ``state_keys``, and has two pure
    functions, :meth:`initial` and :meth:`transition`. Everything else is done here: specs, seeds,
    resets, the count of steps, the time limit. Entries of the TensorDicts, each
    ``[*batch_size, 1]``, but for a state with more numbers (``state_sizes``):

    ============================  ================================================================
    the observations, the state   real
    ``chance``                    U[0, 1), for whoever chooses the action
    ``action``                    real: within the world's range, or the number of one of its set
    ``reward``                    real
    ``terminated``                the episode has come to an end of the task itself
    ``truncated``                 it was cut off by the time limit
    ``done``                      either of them
    ``success``                   it has ended, and succeeded
    ``seed``, ``episode``,        whose random numbers these are, and when (int64)
    ``step``
    ============================  ================================================================

    Besides TorchRL's own ``reset``, in which the environment counts the episodes, there is
    :meth:`restart`, which has no state and compiles.

    Args:
        world: the parameters, an instance of ``schema``.
        batch_size: the shape of the batch of runs; ``()`` is a single one.
        situations: fixed starts, of a shape that broadcasts to ``[*batch_size, values]``
            (:attr:`envs.core.world.WorldConfig.start_values`); random ones by default.
        seed: an integer (run i of the batch gets ``seed + i``) or the seeds themselves, int64 of
            shape ``batch_size``.
        dtype: of everything real.
        device: of everything.

    Attributes:
        seen: the names of the observations.
    """

    schema: ClassVar[type[WorldConfig]]
    state_keys: ClassVar[tuple[str, ...]] = ()
    """The names of the hidden state, real entries that a step carries to the next."""

    situations: Tensor | None
    _seed: Tensor
    _episode: Tensor

    def __init__(
        self,
        world: WorldConfig,
        batch_size: Sequence[int] = (),
        *,
        situations: Tensor | None = None,
        seed: int | Tensor = 0,
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
        self.seed_runs(seed)
        self._make_specs()

    @property
    def state_sizes(self) -> dict[str, int]:
        """The hidden state's entries by their names, each with how many numbers it has."""
        return dict.fromkeys(self.state_keys, 1)

    @abstractmethod
    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        """Return the observations and the state with which an episode begins.

        Args:
            seed, episode: whose, int64 ``[*batch_size, 1]``, for :func:`envs.core.streams.draw`
                with step 0 and ``Stream.START``.
            situations: the starts that are asked for, ``[*batch_size, values]``; else they are
                random.

        Returns:
            Each ``[*batch_size, 1]``. There may be a ``chance``, if the world has random bits to
            spare; else one is drawn.
        """

    @abstractmethod
    def transition(self, state: Entries, action: Tensor) -> Entries:
        """Return what a step leads to.

        Args:
            state: the observations and the state before it, and ``seed``, ``episode`` and the
                number of this step, from 1, for :func:`envs.core.streams.draw` with
                ``Stream.STEP``.
            action: ``[*batch_size, 1]``.

        Returns:
            The observations and the state after it, ``reward`` and ``terminated`` (bool). There may
            be a ``success`` (bool), of an episode that ends here, and a ``chance``.
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
        """Return the state to go on from: where ``done``, the first of the run's next episode.

        Args:
            after: what a step led to, its ``"next"``.
        """
        start = self.start(after["seed"], after["episode"] + 1)
        done = after["done"]
        return self.pack({key: torch.where(done, new, after[key]) for key, new in start.items()})

    def pack(self, entries: Entries) -> TensorDict:
        """Return a TensorDict of this environment's batch."""
        return TensorDict(entries, batch_size=self.batch_size, device=self.device)

    def seed_runs(self, seed: int | Tensor) -> None:
        """Give every run its seed; each begins with its first episode again.

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
        sizes = dict.fromkeys(seen, 1) | self.state_sizes
        self._kept = [*sizes]
        state = {
            key: Unbounded(**(real | {"shape": (*self.batch_size, size)}))
            for key, size in sizes.items()
        }
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
