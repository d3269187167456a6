"""The runs of a job as they were at each evaluation: Q(s, a) from the weights in snapshots.pt."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.func import functional_call

from envs.robot.schemas import FollowOneSideConfig
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.studies.experiments import Job, NoResults
from fnnq_torchrl.training.jobs import SNAPSHOTS
from fnnq_torchrl.training.weights import Snapshots, load_snapshots

Weights = dict[str, Tensor]


@dataclass(frozen=True, eq=False)
class Learner:
    """Runs of one value function that learned on one side, and then on the other.

    They began on the left, which is therefore called the seen side.

    Raises:
        NoResults: on creation, if they began on both sides or the right, or never switched.
    """

    config: Config
    snapshots: Snapshots
    diverged: NDArray[np.bool_]  # [runs, evaluations]

    def __post_init__(self) -> None:
        world = self.config.env
        one_side = isinstance(world, FollowOneSideConfig) and world.start_side == "left"
        if not (one_side and 0 < world.switch_side_after < self.config.situations):
            raise NoResults(
                f"{self.kind}: must have learned with env=follow_one_side on the left, and then on "
                "the right"
            )

    @classmethod
    def of(cls, job: Job) -> Self:
        """The runs of a job, which has left its snapshots.

        Raises:
            NoResults: they aren't there, or of another experiment.
            OSError, ValueError: they can't be read.
        """
        path = job.directory / SNAPSHOTS
        if not path.exists():
            raise NoResults(f"{path} isn't there: checkpoint.snapshots=true leaves it")
        return cls(job.config, load_snapshots(path), job.evaluations.diverged)

    def sound(self) -> Self:
        """The runs that never diverged; of the others' Q nothing can be said.

        Raises:
            NoResults: there are none.
        """
        never = ~self.diverged.any(axis=1)
        if not never.any():
            raise NoResults(f"{self.kind}: all its runs diverged")
        whole, saved = torch.from_numpy(never), self.snapshots
        weights = {name: weight[:, whole] for name, weight in saved.weights.items()}
        kept = replace(saved, weights=weights, seed=saved.seed[whole], lam=saved.lam[whole])
        return replace(self, snapshots=kept, diverged=self.diverged[never])

    @property
    def kind(self) -> str:
        """Which value function it is."""
        kind: str = self.config.value.kind
        return kind

    @property
    def edge_rad(self) -> float:
        """The bearing Δθ where what is seen on the left ends, to the right of straight ahead."""
        world = self.config.env
        return -min(world.other_view_rad, world.field_of_view_rad)

    @property
    def runs(self) -> int:
        """How many there are."""
        return len(self.snapshots.seed)

    @cached_property
    def network(self) -> ValueNetwork:
        """The value function, of a single run, which serves any number of runs' weights."""
        dtype = getattr(torch, self.config.machine.dtype)
        return make_value_network(self.config.value, make_candidates(self.config, dtype), runs=1)

    def page(self, situations: int) -> int:
        """Which evaluation it is that came after so many situations.

        Raises:
            NoResults: there is none.
        """
        pages = (self.snapshots.situations == situations).nonzero().flatten().tolist()
        if len(pages) != 1:
            raise NoResults(f"{self.kind} was not evaluated after {situations} situations")
        return int(pages[0])

    def weights(self, page: int) -> Weights:
        """By name, each ``[runs, ...]``."""
        return {name: weight[page] for name, weight in self.snapshots.weights.items()}

    def values(self, weights: Weights, bearing_rad: Tensor, action: Tensor | None = None) -> Tensor:
        """Q(s, a) of all runs.

        Args:
            weights: by name, each ``[runs, ...]``.
            bearing_rad: Δθ, ``[states]``.
            action: Δv of every state, ``[states]``; all the candidates if not given.

        Returns:
            ``[runs, states, candidates]``, or with an action ``[runs, states, 1]``.
        """

        def of_every_run(x: Tensor) -> Tensor:
            return x.to(self.network.candidates).view(1, -1, 1).expand(self.runs, -1, 1)

        actions = {} if action is None else {"action": of_every_run(action)}
        values: Tensor = functional_call(
            self.network, weights, (of_every_run(bearing_rad),), actions
        )
        return values
