"""The identity of a run: its configuration without the seed, and its seed.

Two runs with equal identities have the same results, bit for bit, even in different jobs. Means and
intervals need independent runs, so they count two such runs as one.
"""

from dataclasses import asdict, dataclass
from typing import Self

from fnnq_torchrl.config.schema import Config

WHICH_RUNS = ("seed", "num_seeds")
"""The keys that choose the seeds of a job's runs; they aren't part of a run's configuration."""

ASIDE = ("resume", "checkpoint", "logger")
"""The keys of saving, resuming and logging, which don't change any result."""


@dataclass(frozen=True)
class JobRuns:
    """The identities of a job's runs.

    Attributes:
        configuration: a text for the configuration. Two jobs have the same text if, and only if,
            they differ at most in the keys `WHICH_RUNS` and `ASIDE`.
        seeds: the seeds of the runs, in their order.
    """

    configuration: str
    seeds: range

    @classmethod
    def of(cls, config: Config) -> Self:
        """Return the identities of the runs of a job with this configuration."""
        kept = {
            key: value for key, value in asdict(config).items() if key not in (*WHICH_RUNS, *ASIDE)
        }
        return cls(repr(kept), range(config.seed, config.seed + config.num_seeds))


class RunsSoFar:
    """A record of the runs added so far, which tells new runs from repeated runs."""

    def __init__(self) -> None:
        self._met: dict[str, set[int]] = {}

    def add(self, runs: JobRuns) -> list[int]:
        """Add the runs of a job, and return the seeds of those that are new."""
        met = self._met.setdefault(runs.configuration, set())
        new = [seed for seed in runs.seeds if seed not in met]
        met.update(new)
        return new
