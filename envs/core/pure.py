"""The base class of environments whose step is a pure function of a TensorDict."""

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
"""The entries that determine the random numbers: int64, ``[*batch_size, 1]``."""

_DRAWN_SEEDS = 2**62
"""The upper bound, exclusive, of the random seed of an unseeded world."""

Entries = dict[str, Tensor]


class PureEnv(EnvBase):
    """The base class of worlds: a batch of independent runs, with all state in the TensorDict.

    A random number depends only on its run's ``seed``, ``episode`` and ``step``
    (:mod:`envs.core.streams`). So a run is the same in every batch, and a loop of steps can be
    compiled.

    A subclass sets ``schema``, lists its hidden state in ``state_keys`` and defines two pure
    functions, :meth:`initial` and :meth:`transition`. This class adds the specs, the seeds, the
    resets, the step count and the time limit. The TensorDicts have these entries, each
    ``[*batch_size, 1]``, except hidden state with more numbers (``state_sizes``):

    ============================  ================================================================
    the observations, the state   real
    ``chance``                    a random number, U[0, 1), with which a policy chooses an action
    ``action``                    real: a number in the world's range, or the index of an action
    ``reward``                    real
    ``terminated``                the task has ended the episode
    ``truncated``                 the time limit has ended the episode
    ``done``                      either of them
    ``success``                   the episode has ended with a success
    ``seed``, ``episode``,        determine the random numbers (int64)
    ``step``
    ============================  ================================================================

    TorchRL's ``reset`` counts the episodes in the environment. :meth:`restart` counts them in the
    TensorDict and can therefore be compiled.

    Args:
        world: the parameters, an instance of ``schema``.
        batch_size: the shape of the batch of runs; ``()`` for a single run.
        situations: fixed starts, broadcast to ``[*batch_size, values]``; the values are named by
            :attr:`envs.core.world.WorldConfig.start_values`. By default all starts are random.
        seed: an integer (run i of the batch gets ``seed + i``) or the runs' seeds, int64 of shape
            ``batch_size``. By default an integer drawn from torch's global generator, which
            ``torch.manual_seed`` makes repeatable.
        dtype: the dtype of all real entries.
        device: the device of all entries.

    Attributes:
        seen: the names of the observations.
    """

    schema: ClassVar[type[WorldConfig]]
    state_keys: ClassVar[tuple[str, ...]] = ()
    """The names of the hidden entries, which are real and pass from each step to the next."""

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

    @property
    def state_sizes(self) -> dict[str, int]:
        """The hidden state's entries by their names, each with how many numbers it has."""
        return dict.fromkeys(self.state_keys, 1)

    @abstractmethod
    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        """Return the observations and the state at the start of an episode.

        Args:
            seed, episode: int64 ``[*batch_size, 1]``, for :func:`envs.core.streams.draw` with step
                0 and ``Stream.START``.
            situations: fixed starts, ``[*batch_size, values]``; None for random ones.

        Returns:
            The entries by name, each ``[*batch_size, 1]``. A world with unused random bits may
            add ``chance``; otherwise this class draws one.
        """

    @abstractmethod
    def transition(self, state: Entries, action: Tensor) -> Entries:
        """Return the observations and the state after a step, its reward and whether it is last.

        Args:
            state: the observations and the state before the step. Also ``seed``, ``episode`` and
                ``step`` (the number of this step, from 1), for :func:`envs.core.streams.draw` with
                ``Stream.STEP``.
            action: ``[*batch_size, 1]``.

        Returns:
            The new observations and state, ``reward`` and ``terminated`` (bool). Optional entries
            are ``chance``; ``success`` (bool), true where an episode ends with a success; and
            ``truncated`` (bool), true where an episode is cut off for another reason than the time
            limit.
        """

    def best_mean(self, step: Tensor) -> Tensor | None:
        """Return the best possible mean reward of a step in a world without end, else None.

        Args:
            step: the number of the step, from 1, int64 ``[*batch_size, 1]``.
        """
        return None

    def start(self, seed: Tensor, episode: Tensor, situations: Tensor | None = None) -> TensorDict:
        """Return the first state of an episode.

        Args:
            seed, episode: int64 ``[*batch_size, 1]``.
            situations: fixed starts, ``[*batch_size, values]``; by default the environment's.
        """
        situations = self.situations if situations is None else situations
        return self.pack({"seed": seed, **self._first(seed, episode, situations)})

    def next_state(self, before: TensorDictBase) -> TensorDict:
        """Return a step's entry ``"next"``: :meth:`step` without TorchRL's checks and repairs.

        A world that passes :func:`.contract.check_world` needs neither.

        Args:
            before: the state before the step, with ``action``.
        """
        entries = dict(before.items())
        state = {key: entries[key] for key in (*self._kept, *WHEN)}
        state["step"] = state["step"] + 1
        after = self.transition(state, entries["action"])
        after |= {key: state[key] for key in WHEN}
        late = after["step"] >= self.world.time_limit_steps
        if "truncated" in after:
            late = late | after["truncated"]
        after["truncated"] = late & ~after["terminated"]
        after["done"] = after["terminated"] | late
        if "success" not in after:
            after["success"] = torch.zeros_like(late)
        return self.pack(self._with_chance(after, after["seed"]))

    def restart(self, after: TensorDictBase) -> TensorDict:
        """Return the state before the next step, which in a ``done`` run starts the next episode.

        Args:
            after: the entry ``"next"`` of a step's result.
        """
        old = dict(after.items())
        first = self._first(old["seed"], old["episode"] + 1, self.situations)
        entries = {key: torch.where(old["done"], new, old[key]) for key, new in first.items()}
        return self.pack({"seed": old["seed"], **entries})

    def pack(self, entries: Entries) -> TensorDict:
        """Return the entries as a TensorDict with this environment's batch size and device."""
        return TensorDict(entries, batch_size=self.batch_size, device=self.device)

    def seed_runs(self, seed: int | Tensor) -> None:
        """Set the seed of every run, so that the next reset starts episode 0.

        Args:
            seed: an integer (run i gets ``seed + i``) or int64 of shape ``batch_size``.
        """
        if not isinstance(seed, Tensor):
            seed = seed + torch.arange(self.batch_size.numel())
        seed = seed.to(self.device, torch.int64).reshape(*self.batch_size, 1).clone()
        # Buffers move to another device with the environment, and are part of its state_dict.
        self.register_buffer("_seed", seed)
        self.register_buffer("_episode", torch.full_like(seed, -1))

    def _first(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        """Return the entries at the start of an episode, except the seed."""
        entries = self.initial(seed, episode, situations)
        entries |= {"episode": episode, "step": torch.zeros_like(episode)}
        return self._with_chance(entries, seed)

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        return self.next_state(tensordict)

    def _with_chance(self, entries: Entries, seed: Tensor) -> Entries:
        if "chance" not in entries:
            words = streams.draw(seed, entries["episode"], entries["step"], Stream.CHANCE)
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
