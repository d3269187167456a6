"""Environments whose step is a pure function of the TensorDict."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

WHEN = "seed", "episode", "step"
"""The entries that say whose random numbers are due, and when: int64, ``[*batch_size, 1]``."""


class PureEnv(EnvBase):
    """A batch of runs that share nothing, with the whole of their state in the TensorDict.

    What is random in a step is drawn from the run's ``seed``, ``episode`` and ``step``
    (:mod:`envs.core.streams`), so a run's history doesn't depend on the batch that it is in, and a
    loop of steps compiles. A subclass has the specs, :meth:`start` and ``_step``; it carries the
    entries ``WHEN`` along, counts ``step``, and gives with every state a ``chance``, U[0, 1), to
    whoever chooses the action. Seeds and resets are done here.

    Besides TorchRL's own ``reset``, in which the environment itself counts the episodes, there is
    :meth:`restart`, which does without.

    Args:
        batch_size: the shape of the batch of runs; ``()`` is a single one.
        seed: an integer (run i of the batch gets ``seed + i``) or the seeds themselves, int64 of
            shape ``batch_size``.
        dtype: of everything real.
        device: of everything.
    """

    _seed: Tensor
    _episode: Tensor

    def __init__(
        self,
        batch_size: Sequence[int],
        seed: int | Tensor,
        dtype: torch.dtype,
        device: torch.device | str | None,
    ) -> None:
        super().__init__(device=device, batch_size=torch.Size(batch_size))
        self.dtype = dtype
        self.seed_runs(seed)

    @property
    def fewest_steps(self) -> int:
        """No episode ends in fewer steps."""
        return 1

    @abstractmethod
    def start(self, seed: Tensor, episode: Tensor) -> TensorDict:
        """The first state of an episode.

        Args:
            seed, episode: int64 ``[*batch_size, 1]``.
        """

    def restart(self, after: TensorDictBase) -> TensorDict:
        """The state to go on from: where ``done``, the first of the run's next episode.

        Args:
            after: what a step led to, its ``"next"``.
        """
        start = self.start(after["seed"], after["episode"] + 1)
        done = after["done"]
        return self.pack({key: torch.where(done, new, after[key]) for key, new in start.items()})

    def pack(self, entries: dict[str, Tensor]) -> TensorDict:
        """A TensorDict of this environment's batch."""
        return TensorDict(entries, batch_size=self.batch_size, device=self.device)

    def seed_runs(self, seed: int | Tensor) -> None:
        """Give every run its seed; each is to begin with its first episode again.

        Args:
            seed: an integer (run i gets ``seed + i``) or int64 of shape ``batch_size``.
        """
        if not isinstance(seed, Tensor):
            seed = seed + torch.arange(self.batch_size.numel())
        seed = seed.to(self.device, torch.int64).reshape(*self.batch_size, 1).clone()
        # As buffers they go along with the environment to another device and into its state_dict.
        self.register_buffer("_seed", seed)
        self.register_buffer("_episode", torch.full_like(seed, -1))

    def _set_seed(self, seed: int | None) -> None:
        if seed is not None:
            self.seed_runs(seed)

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDict:
        due = None if tensordict is None else tensordict.get("_reset", None)
        self._episode = self._episode + (1 if due is None else due.view_as(self._episode))
        return self.start(self._seed.clone(), self._episode.clone())
