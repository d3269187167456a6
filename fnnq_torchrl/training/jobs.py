"""A job, the names of its files, and its result. This module doesn't import torch."""

from dataclasses import dataclass
from pathlib import Path

from fnnq_torchrl.config.schema import PER_RUN, Config

BATCHABLE = (*PER_RUN, "num_seeds")
"""The only configuration keys in which the jobs of a batch may differ."""

TRAINING = "training.pt"
"""The file that holds an unfinished training."""

RESULTS = ("checkpoint.pt", "evaluations.csv", "summary.json")
"""The files that every finished job has, in the order in which they are written."""

PICTURE = "learning_curve.png"
"""The file with the learning curve."""

PARAMETERS_PICTURE = "parameters.png"
"""The file with the course of the learning parameters, drawn if they are adaptive."""

VIDEO = "robot.gif"
"""The file with the video of the robot after learning, drawn with ``logger.video=true``."""

SNAPSHOTS = "snapshots.pt"
"""The file with the weights of all evaluations, written with ``checkpoint.snapshots=true``."""


@dataclass(frozen=True)
class Job:
    """A job: its configuration, its output directory, and the directory of its sweep, if any."""

    config: Config
    directory: Path
    sweep: Path | None = None


class JobFailed(Exception):
    """A job that ended without a result; the message gives the reason in one line."""


Result = float | Exception | None
"""The mean score of a job, or the error that ended it."""
