"""Published results on Mountain Car, read off plots by eye.

Source: S. Zhang's public replication of the figures of R. S. Sutton, A. G. Barto, "Reinforcement
learning", 2018. Its means are over 30 runs.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

RUNS = 30
"""The number of runs of the replication."""

TILINGS = 8
"""The number of tilings: the axis of the book's figures is α times this."""


class Point(NamedTuple):
    """The best value of a published curve, the α · 8 of that value, and its reading error."""

    value: float
    at: float
    reading: float


STEPS = {
    0.0: Point(228, 1.5, 2),
    0.5: Point(212, 1.5, 2),
    0.95: Point(180, 1.0, 2),
    0.99: Point(205, 0.75, 2),
}
"""Figure 12.10, by λ: steps an episode over the first 50 episodes, with replacing traces."""

REWARDS = {
    "dutch": Point(-266, 1.6, 5),
    "replacing": Point(-270, 1.4, 5),
    "clearing": Point(-312, 1.6, 5),
    "gradient": Point(-406, 0.2, 5),
}
"""Figure 12.11, by the trace: the reward of an episode over the first 20 episodes, λ = 0.9."""


class Comparison(NamedTuple):
    """The difference of our mean from a published point, and the error of that difference.

    Attributes:
        difference: our mean less the published value.
        error: √(s.e.² + reading error²), where s.e. is the standard error of the difference of the
            two means. The spread of the published runs isn't known; it is assumed to equal ours.
    """

    difference: float
    error: float

    @property
    def agrees(self) -> bool:
        """True if the difference is at most twice its error."""
        return abs(self.difference) <= 2 * self.error


def compare(runs: ArrayLike, point: Point) -> Comparison:
    """Compare the mean of our runs, ``[runs]``, at least 2, with a published point."""
    ours = np.asarray(runs, dtype=np.float64)
    standard_error = ours.std(ddof=1) * sqrt(1 / RUNS + 1 / ours.size)
    return Comparison(ours.mean() - point.value, sqrt(standard_error**2 + point.reading**2))
