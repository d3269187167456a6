"""What becomes of the side learned first when the other is learned."""

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
        kind: which value function it is.
        caught: of the first side's tests, after it and after the second, ``[runs, 2]``.
        diverged: the runs that had by then, ``[runs, 2]``.
    """

    kind: str
    caught: Numbers
    diverged: NDArray[np.bool_]

    @classmethod
    def of(cls, learner: Learner, caught: Numbers | None = None) -> Self:
        """Have the runs play.

        Args:
            learner: the runs.
            caught: if that is known already.

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
        """Catches that the second side has brought or, below 0, cost, ``[runs]``.

        Of the runs that had not diverged before; the others have nothing to forget.
        """
        change: Numbers = (self.caught[:, 1] - self.caught[:, 0])[~self.diverged[:, 0]]
        return change
