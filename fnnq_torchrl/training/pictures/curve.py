"""The data of a learning curve. No Matplotlib here."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Curve(NamedTuple):
    """The runs of one configuration."""

    name: str
    situations: NDArray[np.int64]  # [evaluations], learning situations before each
    scores: NDArray[Any]  # [runs, evaluations]
    diverged: int  # runs; from then on they have the worst possible score

    @property
    def words(self) -> list[str]:
        """The name and, if there are any, the number of diverged runs."""
        return [self.name] + [f"({self.diverged:,} diverged)"] * (self.diverged > 0)

    @property
    def label(self) -> str:
        """The same in one line."""
        return " ".join(self.words)

    @property
    def mean_score(self) -> NDArray[np.float64]:
        """The mean of each run after learning began, ``[runs]``."""
        return self.scores[:, 1:].mean(axis=1)
