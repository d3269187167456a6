"""Catches on the side learned first, before and after the other side is learned."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from .learners import Learner
from .playing import catches

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FirstSide:
    """Catches on the side learned first.

    Attributes:
        kind: the kind of value function.
        caught: catches in the first side's tests, after the first side and after the second,
            ``[runs, 2]``.
        diverged: whether a run had diverged by then, ``[runs, 2]``.
    """

    kind: str
    caught: Numbers
    diverged: NDArray[np.bool_]

    @classmethod
    def of(cls, learner: Learner, caught: Numbers | None = None) -> Self:
        """Let the runs play the first side's tests.

        Args:
            learner: the runs.
            caught: their catches, if they are known already.

        Raises:
            NoResults: there is no evaluation after a side.
        """
        moments = (learner.config.env.switch_side_after, learner.config.situations)
        pages = [learner.page(situations) for situations in moments]
        if caught is None:
            caught = catches(learner, pages, 1)
        return cls(learner.kind, caught, learner.diverged[:, pages])

    @property
    def kept(self) -> Numbers:
        """The catches that learning the second side added or, below 0, cost, ``[runs]``.

        Runs that had diverged before are left out: they have nothing to forget.
        """
        change: Numbers = (self.caught[:, 1] - self.caught[:, 0])[~self.diverged[:, 0]]
        return change
