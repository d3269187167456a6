"""All that is measured of one value function's runs."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray

from .interference import distances, interference
from .learners import Learner
from .movement import Regions, greedy_change_beyond, movement, regions, state_values
from .playing import catches, shares_beyond

INTERFERENCE_AFTER = (5, 50, 200)
"""Situations of learning after which interference is measured."""

ACTIONS = torch.linspace(-1, 1, 5)
"""Δv of the updates whose interference is measured."""

FAR_RAD = 0.5
"""States at least so far apart are told in one number."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Findings:
    """Of every run of a value function; the first dimension of all arrays is the runs.

    Attributes:
        learner: the runs.
        where: the states of `fnnq_torchrl.extrapolation.movement.STATES` by what was seen of them.
        moved: after the first side, per unit of the seen side (`movement`), ``[runs, states]``.
        values: V before learning, after the first side and after the second, ``[runs, 3, states]``.
        beyond: how far the greedy action changes beyond the field of view, on the seen side and on
            the other, ``[runs, 2]``, in units of Δv.
        caught: of the tests, before, after the first side and after the second, on the side learned
            first and on the other, ``[runs, 3, 2]``.
        hidden: share of the states visited on the first side that are farther to the right than the
            head sees, ``[runs]``.
        would_see: share that, with a head that sees both sides, would be to the right of straight
            ahead, and farther to the right than that, ``[runs, 2]``.
        spread: interference by the distance, after each of `INTERFERENCE_AFTER`, ``[runs, 3,
            distances]``.
    """

    learner: Learner
    where: Regions
    moved: Numbers
    values: Numbers
    beyond: Numbers
    caught: Numbers
    hidden: Numbers
    would_see: Numbers
    spread: Numbers

    @classmethod
    def of(cls, learner: Learner) -> Self:
        """Measure.

        Raises:
            NoResults: there is no evaluation at the switch, or at one of `INTERFERENCE_AFTER`.
        """
        config = learner.config
        pages = [
            learner.page(situations)
            for situations in (0, config.env.switch_side_after, config.situations)
        ]
        edge_rad = -min(config.env.other_view_rad, config.env.field_of_view_rad)
        spread = [
            interference(learner, learner.page(after), ACTIONS) for after in INTERFERENCE_AFTER
        ]
        return cls(
            learner=learner,
            where=regions(learner),
            moved=movement(learner, pages[1]),
            values=np.stack([state_values(learner, page) for page in pages], axis=1),
            beyond=np.stack(greedy_change_beyond(learner, pages[1]), axis=1),
            caught=np.stack([catches(learner, pages, side) for side in (1, -1)], axis=2),
            hidden=shares_beyond(learner, [edge_rad], whole_view=False)[:, 0],
            would_see=shares_beyond(learner, [0.0, edge_rad], whole_view=True),
            spread=np.stack(spread, axis=1),
        )

    @property
    def kind(self) -> str:
        """Which value function it is."""
        return self.learner.kind

    def moved_in(self, region: NDArray[np.bool_]) -> Numbers:
        """The mean movement over some of the states, ``[runs]``."""
        mean: Numbers = self.moved[:, region].mean(axis=1)
        return mean

    @property
    def helped(self) -> Numbers:
        """Catches on the other side that the first has brought, ``[runs]``."""
        return self.caught[:, 1, 1] - self.caught[:, 0, 1]

    @property
    def forgotten(self) -> Numbers:
        """Catches on the first side that the other has cost, ``[runs]``."""
        return self.caught[:, 1, 0] - self.caught[:, 2, 0]

    @property
    def far(self) -> Numbers:
        """Interference at `FAR_RAD` or more, after the last of `INTERFERENCE_AFTER`, ``[runs]``."""
        mean: Numbers = self.spread[:, -1, distances() >= FAR_RAD].mean(axis=1)
        return mean
