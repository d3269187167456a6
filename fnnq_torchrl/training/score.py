"""The score of a job's tests: the measure, its bounds, and the words for the score."""

from math import inf, isfinite
from typing import NamedTuple, Self

from fnnq_torchrl.config.schema import Config

_WORDS = {
    ("return", True): "return, mean over the test's episodes",
    ("length", True): "steps of an episode, mean over the test's",
    ("return", False): "return, mean over the episodes learned from",
    ("length", False): "steps of an episode, mean over those learned from",
}
"""The description of a score, by its measure and whether tests are played."""


class Score(NamedTuple):
    """A measure, and the lowest and highest score that a test can have."""

    measure: str = "successes"  # or "return" or "length": see `WorldConfig.measure`
    low: float = 0.0
    high: float = inf
    successes: str = "successes"  # the world's word for successes, in the plural
    tested: bool = True  # False if the score is that of the episodes learned from

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the score that the tests of a valid configuration have."""
        world = config.env.tested
        bounds = {
            "successes": (0, config.best_score or 0),
            "return": world.returns or (-inf, inf),
            "length": (0, world.time_limit_steps),
        }
        low, high = bounds[world.measure]
        return cls(world.measure, low, high, world.successes, config.evaluation.tests > 0)

    @property
    def bounds(self) -> tuple[float, float]:
        """The lowest and the highest possible score."""
        return self.low, self.high

    @property
    def name(self) -> str:
        """One word for the score, such as ``catches`` or ``return``."""
        return self.successes if self.measure == "successes" else self.measure

    @property
    def words(self) -> str:
        """The words for the score as the label of an axis."""
        if self.measure != "successes":
            return _WORDS[self.measure, self.tested]
        of = f" of {self.high:g}" if isfinite(self.high) else ""
        return f"score ({self.successes}{of})"

    def joined(self, other: Self) -> Self:
        """Return this score with bounds that include the bounds of the other score."""
        return self._replace(low=min(self.low, other.low), high=max(self.high, other.high))
