"""Jobs: their configurations, files and results. No torch here."""

from dataclasses import dataclass
from pathlib import Path

from fnnq_torchrl.config.schema import PER_RUN, Config

BATCHABLE = (*PER_RUN, "num_seeds")
"""The keys in which jobs of one batch may differ; in all others they are equal."""

ASIDE = ("resume", "checkpoint", "logger")
"""The keys on which no result depends: those of saving, resuming and logging."""

TRAINING = "training.pt"
"""The file of a training that isn't finished."""

RESULTS = ("checkpoint.pt", "evaluations.csv", "summary.json")
"""The files that every finished job has, the last of them written last."""

PICTURE = "learning_curve.png"
"""The file with the learning curve."""

SNAPSHOTS = "snapshots.pt"
"""The file with the weights of all evaluations, written with ``checkpoint.snapshots=true``."""


@dataclass(frozen=True)
class Job:
    """A job's configuration, the directory it writes to, and the directory of its sweep if any."""

    config: Config
    directory: Path
    sweep: Path | None = None


class JobFailed(Exception):
    """A job has ended without a result; the message is one line with the reason."""


Result = float | Exception | None
"""A job's objective, or the error that it ended with."""
