"""Jobs that train side by side in one batch of runs."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.engine.choice import choose_engine
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.start import Start, read_start


class Batch:
    """Some jobs as one.

    Args:
        jobs: equal but for `BATCHABLE`, at least one.

    Attributes:
        jobs: these.
        config: what they have in common.
        size: the number of runs of all jobs.
        engine: what runs their steps.
        directory: that of the last job, where the batch's training is saved. The last job's own
            files are written when all the others' are: where one is missing, its are too.

    Raises:
        ConfigError: the engine is to compile, and there is no C++ compiler.
    """

    def __init__(self, jobs: Sequence[Job]) -> None:
        self.jobs = jobs
        self.config = jobs[0].config
        self.size = sum(job.config.num_seeds for job in jobs)
        self.engine = choose_engine(self.config, self.size)
        self.directory: Path = jobs[-1].directory

    @cached_property
    def start(self) -> Start | None:
        """Where learning starts, if not at the value network's own start.

        Raises:
            ConfigError, OSError: as in :func:`.read_start`.
        """
        return read_start(self.config)

    @cached_property
    def runs(self) -> Runs:
        """The runs of all jobs, one job's after the other's."""
        return Runs.of([job.config for job in self.jobs])
