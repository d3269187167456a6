"""The runs of a job at each of its evaluations: Q(s, a) from the weights in snapshots.pt."""

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
from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.studies.experiments import Job, NoResults
from fnnq_torchrl.training.jobs import SNAPSHOTS
from fnnq_torchrl.training.weights import Snapshots, load_snapshots

Weights = dict[str, Tensor]


def kind_of(config: Config) -> str:
    """Return what the page calls a value function: its kind and, if not Gaussian, its labels."""
    value = config.value
    labels = value.inputs["bearing"] if isinstance(value, LabelsConfig) else []
    shapes = {next(iter(label)) for label in labels if isinstance(label, dict)}
    words = "".join(f", {len(labels)} {shape}s" for shape in sorted(shapes))
    return f"{value.kind}{words}"


@dataclass(frozen=True, eq=False)
class Learner:
    """Runs of one value function that learned on the left, and then on the right.

    The left is called the seen side.

    Raises:
        NoResults: on creation, if the runs didn't begin on the left alone, or never switched.
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
        """Read the runs of a job from its snapshots.

        Raises:
            NoResults: there are no snapshots, or they are of another experiment.
            OSError, ValueError: the snapshots can't be read.
        """
        path = job.directory / SNAPSHOTS
        if not path.exists():
            raise NoResults(f"{path} isn't there: checkpoint.snapshots=true leaves it")
        return cls(job.config, load_snapshots(path), job.evaluations.diverged)

    def sound(self) -> Self:
        """Return the runs that never diverged. The Q of the others says nothing.

        Raises:
            NoResults: all runs diverged.
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
        """The value function, as the page calls it."""
        return kind_of(self.config)

    @property
    def edge_rad(self) -> float:
        """The bearing Δθ at the edge of the seen states, to the right of straight ahead."""
        world = self.config.env
        return -min(world.other_view_rad, world.field_of_view_rad)

    @property
    def runs(self) -> int:
        """The number of runs."""
        return len(self.snapshots.seed)

    @cached_property
    def network(self) -> ValueNetwork:
        """The value function of a single run, which can be called with the weights of many runs."""
        dtype = getattr(torch, self.config.machine.dtype)
        return make_value_network(self.config.value, make_candidates(self.config, dtype), runs=1)

    def page(self, situations: int) -> int:
        """Return the index of the evaluation after a number of situations.

        Raises:
            NoResults: there is none.
        """
        pages = (self.snapshots.situations == situations).nonzero().flatten().tolist()
        if len(pages) != 1:
            raise NoResults(f"{self.kind} was not evaluated after {situations} situations")
        return int(pages[0])

    def weights(self, page: int) -> Weights:
        """Return the weights at an evaluation by name, each ``[runs, ...]``."""
        return {name: weight[page] for name, weight in self.snapshots.weights.items()}

    def values(self, weights: Weights, bearing_rad: Tensor, action: Tensor | None = None) -> Tensor:
        """Return Q(s, a) of all runs.

        Args:
            weights: the weights by name, each ``[runs, ...]``.
            bearing_rad: Δθ, ``[states]``.
            action: Δv in each state, ``[states]``; all candidates if None.

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
