"""A batch: jobs whose runs train side by side."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.engine.choice import choose_engine
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.start import Start, read_start
from fnnq_torchrl.training.terminal import line_label


class Batch:
    """Jobs whose runs are trained together.

    Args:
        jobs: one or more jobs, which differ only in the keys of `BATCHABLE`.
        part: the words for this batch among several, such as ``batch 2 of 3``.

    Attributes:
        jobs: the jobs.
        label: the beginning of each log line about this batch.
        config: the configuration of the first job. Those of the others differ only in the keys of
            `BATCHABLE`.
        size: the number of runs, of all jobs together.
        engine: the engine that runs the steps.
        directory: the directory of the last job, where the unfinished training is saved. The files
            of the last job are written last, so the saved training stays until all are written.

    Raises:
        ConfigError: if the engine must compile, and there is no C++ compiler.
    """

    def __init__(self, jobs: Sequence[Job], part: str = "") -> None:
        self.jobs = jobs
        self.label = line_label(jobs[0].sweep or jobs[0].directory, part)
        self.config = jobs[0].config
        self.size = sum(job.config.num_seeds for job in jobs)
        self.engine = choose_engine(self.config, self.size)
        self.directory: Path = jobs[-1].directory

    @cached_property
    def start(self) -> Start | None:
        """The start of learning; None for the value network's own start.

        Raises:
            ConfigError, OSError: as in :func:`.read_start`.
        """
        return read_start(self.config)

    @cached_property
    def runs(self) -> Runs:
        """The per-run values of all jobs, in the order of the jobs."""
        return Runs.of([job.config for job in self.jobs])
