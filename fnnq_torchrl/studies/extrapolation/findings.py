"""All measurements on the runs of one value function."""

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
"""The numbers of situations of learning after which interference is measured."""

ACTIONS = torch.linspace(-1, 1, 5)
"""The actions Δv of the updates whose interference is measured."""

FAR_RAD = 0.5
"""Interference at this distance or a larger one is averaged to a single number."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Findings:
    """The measurements on a value function's runs.

    The first dimension of every array is the runs: all of them in `caught` and `control`, and only
    those that never diverged in the others.

    Attributes:
        learner: the learner that holds all runs.
        sound: the learner that holds the runs that never diverged.
        where: the regions of `.movement.STATES`: seen, unseen, and beyond the field of view.
        moved: the movement of Q in each state while the first side was learned, divided by its
            mean over the seen states (`movement`), ``[runs, states]``.
        values: V before learning, after the first side and after the second, ``[runs, 3, states]``.
        beyond: the change of the greedy action from the edge of the field of view to beyond it, on
            the seen side and on the other, ``[runs, 2]``, in units of Δv.
        towards: the share of the seen states, and of the unseen states, where the greedy action
            turns towards the ball after the first side, ``[runs, 2]``.
        caught: the catches before learning, after the first side and after the second (dimension
            1), in the tests of the first side and of the second (dimension 2), ``[runs, 3, 2]``.
        control: the catches in the other side's tests after the first side, with random actions
            in the unseen states, ``[runs]``.
        hidden: the unseen side's share of the states visited while the first side was learned,
            ``[runs]``.
        would_see: two shares of the states visited with a head that sees both sides: those with
            the ball to the right, and those with it on the unseen side, ``[runs, 2]``.
        spread: the interference by distance after each number of situations in
            `INTERFERENCE_AFTER`, with the initial α,
            ``[runs, 3, distances]``.
        spread_decayed: the interference by distance after the last of these numbers, with
            `decayed_alpha`, ``[runs, distances]``.
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
        """Measure the runs.

        Raises:
            NoResults: if there is no evaluation at the switch, at the end or after one of
                `INTERFERENCE_AFTER`, or if all runs diverged.
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
        """The kind of value function."""
        return self.learner.kind

    def moved_in(self, region: NDArray[np.bool_]) -> Numbers:
        """Return the mean movement over the states of a region, ``[runs]``."""
        mean: Numbers = self.moved[:, region].mean(axis=1)
        return mean

    @property
    def helped(self) -> Numbers:
        """The catches on the second side that are due to Q in unseen states, ``[runs]``.

        This is the difference between the tests after the first side and their `control`.
        """
        return self.caught[:, 1, 1] - self.control

    @property
    def first_side(self) -> FirstSide:
        """The catches on the side learned first, before and after the other was learned."""
        return FirstSide.of(self.learner, self.caught[:, 1:, 0])

    @property
    def far(self) -> tuple[Numbers, Numbers]:
        """The interference at `FAR_RAD` or more, after the last of `INTERFERENCE_AFTER`.

        The first array is with the initial α, the second with `decayed_alpha`; ``[runs]`` each.
        """
        far = distances() >= FAR_RAD
        return self.spread[:, -1, far].mean(axis=1), self.spread_decayed[:, far].mean(axis=1)


def decayed_alpha(config: Config) -> float:
    """Return α after the last of `INTERFERENCE_AFTER` if every situation ended in a catch."""
    return float(config.alpha * config.alpha_decay ** INTERFERENCE_AFTER[-1])
