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
        diverged: True for each run that had diverged by that moment, ``[runs, 2]``.
    """

    kind: str
    caught: Numbers
    diverged: NDArray[np.bool_]

    @classmethod
    def of(cls, learner: Learner, caught: Numbers | None = None) -> Self:
        """Return the catches of some runs in the first side's tests.

        Args:
            learner: the runs.
            caught: their catches, ``[runs, 2]``, if known; otherwise the runs play the tests.

        Raises:
            NoResults: if there is no evaluation after the first side or after the second.
        """
        moments = (learner.config.env.switch_side_after, learner.config.situations)
        pages = [learner.page(situations) for situations in moments]
        if caught is None:
            caught = catches(learner, pages, 1)
        return cls(learner.kind, caught, learner.diverged[:, pages])

    @property
    def kept(self) -> Numbers:
        """The change in catches while the second side was learned, ``[runs]``; negative is a loss.

        Runs that diverged on the first side are left out: they have nothing to forget.
        """
        change: Numbers = (self.caught[:, 1] - self.caught[:, 0])[~self.diverged[:, 0]]
        return change
