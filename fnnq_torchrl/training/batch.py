"""Jobs that train side by side in one batch of runs."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.engine.choice import choose_engine
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.terminal import line_label


class Batch:
    """Jobs whose runs are trained together.

    Args:
        jobs: one or more, which differ only in the keys of `BATCHABLE`.
        part: the place of this batch among several, in words.

    Attributes:
        jobs: all jobs.
        label: the beginning of each line about this batch.
        config: the first job's; the others' have other values of those keys.
        size: the number of runs of all jobs.
        engine: runs the steps.
        directory: that of the last job, where the batch's training is saved. The last job's own
            files are written after all others, so the training is there until all are written.

    Raises:
        ConfigError: the engine must compile, and there is no C++ compiler.
    """

    def __init__(self, jobs: Sequence[Job], part: str = "") -> None:
        self.jobs = jobs
        self.label = line_label(jobs[0].sweep or jobs[0].directory, part)
        self.config = jobs[0].config
        self.size = sum(job.config.num_seeds for job in jobs)
        self.engine = choose_engine(self.config, self.size)
        self.directory: Path = jobs[-1].directory

    @cached_property
    def runs(self) -> Runs:
        """The runs of all jobs, in the order of the jobs."""
        return Runs.of([job.config for job in self.jobs])
