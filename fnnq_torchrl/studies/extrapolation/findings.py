"""All that is measured of one value function's runs."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.config.schema import Config

from .forgetting import FirstSide
from .interference import distances, interference
from .learners import Learner
from .movement import (
    Regions,
    greedy_change_beyond,
    movement,
    regions,
    state_values,
    towards_the_ball,
)
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

    That is all of them in `caught`, and those that never diverged in all else.

    Attributes:
        learner: all runs.
        sound: those that never diverged.
        where: the states of `.movement.STATES` by what was seen of them.
        moved: after the first side, per unit of the seen side (`movement`), ``[runs, states]``.
        values: V before learning, after the first side and after the second, ``[runs, 3, states]``.
        beyond: how far the greedy action changes beyond the field of view, on the seen side and on
            the other, ``[runs, 2]``, in units of Δv.
        towards: share of the seen states, and of the unseen ones, where the greedy action turns
            towards the ball after the first side, ``[runs, 2]``.
        caught: of the tests, before, after the first side and after the second, on the side learned
            first and on the other, ``[runs, 3, 2]``.
        control: of the other side's, after the first, with random actions where nothing was seen,
            ``[runs]``.
        hidden: share of the states visited on the first side that are farther to the right than the
            head sees, ``[runs]``.
        would_see: share that, with a head that sees both sides, would be to the right of straight
            ahead, and farther to the right than that, ``[runs, 2]``.
        spread: interference by the distance, after each of `INTERFERENCE_AFTER`, with the α of the
            start, ``[runs, 3, distances]``.
        spread_decayed: the same after the last of them with `decayed_alpha`, ``[runs, distances]``.
    """

    learner: Learner
    sound: Learner
    where: Regions
    moved: Numbers
    values: Numbers
    beyond: Numbers
    towards: Numbers
    caught: Numbers
    control: Numbers
    hidden: Numbers
    would_see: Numbers
    spread: Numbers
    spread_decayed: Numbers

    @classmethod
    def of(cls, learner: Learner) -> Self:
        """Measure.

        Raises:
            NoResults: there is no evaluation at the switch, or at one of `INTERFERENCE_AFTER`.
        """
        config, sound = learner.config, learner.sound()
        pages = [
            learner.page(situations)
            for situations in (0, config.env.switch_side_after, config.situations)
        ]
        moments = [learner.page(after) for after in INTERFERENCE_AFTER]
        return cls(
            learner=learner,
            sound=sound,
            where=regions(sound),
            moved=movement(sound, pages[1]),
            values=np.stack([state_values(sound, page) for page in pages], axis=1),
            beyond=np.stack(greedy_change_beyond(sound, pages[1]), axis=1),
            towards=np.stack(towards_the_ball(sound, pages[1]), axis=1),
            caught=np.stack([catches(learner, pages, side) for side in (1, -1)], axis=2),
            control=catches(learner, pages[1:2], -1, indifferent=True)[:, 0],
            hidden=shares_beyond(sound, [sound.edge_rad], whole_view=False)[:, 0],
            would_see=shares_beyond(sound, [0.0, sound.edge_rad], whole_view=True),
            spread=np.stack(
                [interference(sound, page, ACTIONS, config.alpha) for page in moments], axis=1
            ),
            spread_decayed=interference(sound, moments[-1], ACTIONS, decayed_alpha(config)),
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
        """Catches on the other side that Q brings where nothing was seen, ``[runs]``."""
        return self.caught[:, 1, 1] - self.control

    @property
    def first_side(self) -> FirstSide:
        """The side learned first, when the other had been learned, too."""
        return FirstSide.of(self.learner, self.caught[:, 1:, 0])

    @property
    def far(self) -> tuple[Numbers, Numbers]:
        """Interference at `FAR_RAD` or more, after the last of `INTERFERENCE_AFTER`.

        With the α of the start, and with `decayed_alpha`; each ``[runs]``.
        """
        far = distances() >= FAR_RAD
        return self.spread[:, -1, far].mean(axis=1), self.spread_decayed[:, far].mean(axis=1)


def decayed_alpha(config: Config) -> float:
    """The smallest α there can be after the last of `INTERFERENCE_AFTER`: all were catches."""
    return float(config.alpha * config.alpha_decay ** INTERFERENCE_AFTER[-1])
