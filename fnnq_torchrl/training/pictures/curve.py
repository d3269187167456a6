"""The data of a learning curve. This module doesn't import Matplotlib."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Curve(NamedTuple):
    """The scores of all runs of one configuration, at each evaluation."""

    name: str
    situations: NDArray[np.int64]  # [evaluations], learning situations before each one
    scores: NDArray[Any]  # [runs, evaluations]
    diverged: int  # the number of diverged runs

    @property
    def words(self) -> list[str]:
        """The name and, if any runs diverged, their number, as separate texts."""
        return [self.name] + [f"({self.diverged:,} diverged)"] * (self.diverged > 0)

    @property
    def label(self) -> str:
        """The name and the number of diverged runs in one line."""
        return " ".join(self.words)

    @property
    def mean_score(self) -> NDArray[np.float64]:
        """The mean score of each run, without the evaluation before learning, ``[runs]``."""
        return self.scores[:, 1:].mean(axis=1)
