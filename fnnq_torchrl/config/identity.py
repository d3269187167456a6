"""The identity of a run: its configuration without the seed, and its seed.

Two runs of equal identity are the same run, bit for bit, whichever jobs they belong to. Means and
intervals take independent runs, so they count such a run once.
"""

from dataclasses import asdict, dataclass
from typing import Self

from fnnq_torchrl.config.schema import Config

WHICH_RUNS = ("seed", "num_seeds")
"""The keys that choose the seeds of a job's runs, and don't change their configuration."""

ASIDE = ("resume", "checkpoint", "logger")
"""The keys of saving, resuming and logging, which don't change any result."""


@dataclass(frozen=True)
class JobRuns:
    """The identities of a job's runs.

    Attributes:
        configuration: a text that jobs share exactly if they differ only in `WHICH_RUNS` and
            `ASIDE`.
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
    """The runs met so far, which tells new runs from repeated ones."""

    def __init__(self) -> None:
        self._met: dict[str, set[int]] = {}

    def add(self, runs: JobRuns) -> list[int]:
        """Add the runs of a job, and return the seeds of those that are new."""
        met = self._met.setdefault(runs.configuration, set())
        new = [seed for seed in runs.seeds if seed not in met]
        met.update(new)
        return new
