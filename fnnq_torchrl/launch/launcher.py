"""Runs the jobs of a Hydra multirun in batches, whose jobs differ only in per-run values.

Each job has all that Hydra gives to a job: its own directory with ``.hydra``, log and result files,
and a return value. The plugin that Hydra loads is ``hydra_plugins/fnnq_torchrl.py``.
"""

import logging
import os
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import (
    JobReturn,
    JobRuntime,
    JobStatus,
    configure_log,
    env_override,
    run_job,
)
from hydra.types import HydraContext
from omegaconf import DictConfig

from envs.core.parameters import check
from fnnq_torchrl.config.identity import JobRuns
from fnnq_torchrl.config.launcher import LauncherConfig
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.batches import RunBatches, in_batches
from fnnq_torchrl.launch.composition import key_of
from fnnq_torchrl.launch.swept_jobs import SweptJob, Templates, compose_jobs
from fnnq_torchrl.training.jobs import PICTURE, JobFailed, Result

if TYPE_CHECKING:
    from fnnq_torchrl.launch.sweep import SweptResult
    from fnnq_torchrl.training.loggers import Loggers

log = logging.getLogger(__name__)


class Multirun:
    """One multirun; its sweeper launches jobs once or several times.

    Args:
        settings: the launcher's settings, as in ``conf/hydra/launcher/batch.yaml``.
        context: Hydra's context.
        config: the configuration of the multirun itself.
        run_batches: the function that trains batches.

    Raises:
        ConfigError: if a setting isn't allowed.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        context: HydraContext,
        config: DictConfig,
        run_batches: RunBatches,
    ) -> None:
        self._settings = LauncherConfig(**settings)
        check(self._settings, "hydra.launcher.")
        self._context, self._config, self._run_batches = context, config, run_batches
        self._directory = Path(config.hydra.sweep.dir)
        self._jobs: list[SweptJob] = []
        self._templates: Templates = {}
        self._to_draw = False  # whether a launch has ended since the last picture
        self._loggers: Loggers | None = None  # made when there is a job to run

    def launch(self, job_overrides: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run the next jobs of the multirun; jobs that are finished already are not run again.

        Args:
            job_overrides: the overrides of each job.
            first: the number of the first of these jobs.

        Returns:
            Hydra's return value of each job.

        Raises:
            ConfigError: if a job isn't valid, or its directory holds another job. It is raised
                before any of these jobs runs.
            JobFailed: if a result file of a finished job is damaged.
        """
        self._log()
        self._to_draw = False  # a launch that is cut short draws nothing
        loader, templates = self._context.config_loader, self._templates
        jobs = compose_jobs(loader, self._config, job_overrides, first, templates)
        _check_directories([*self._jobs, *jobs])
        missing = []
        for job in jobs:
            if job.is_finished():
                job.clear()
            else:
                missing.append(job)
        if len(missing) < len(jobs):
            done = len(jobs) - len(missing)
            log.info(f"{self._directory}: finished already: {done:,} of {len(jobs):,} jobs")
        pictures = len(jobs) <= self._settings.pictures_up_to
        for job in missing:
            job.write_configuration()
        with env_override(self._config.hydra.job.env_set):
            results = self._run(missing, pictures)
        if pictures:  # a job may have been killed between its results and its picture
            _draw([job for job in jobs if job.directory not in results])
        try:
            returns = [self._end(job, results) for job in jobs]
            self._log()
            self._jobs += jobs
            self._write_whole(first)
            self._to_draw = True
        except ValueError as error:
            advice = "remove its summary.json to compute the job again"
            raise JobFailed(f"{error}; {advice}") from error
        return returns

    def end(self) -> None:
        """Draw the curves of the sweep, unless its last launch was cut short; log it, and close."""
        if self._to_draw:
            self._draw_whole()
        if self._loggers is None:
            return
        from fnnq_torchrl.training.loggers import SweepResults

        with closing(self._loggers):
            jobs = [job.job for job in self._jobs]
            self._loggers.log_sweep(SweepResults(self._directory.absolute(), jobs))

    def _run(self, jobs: Sequence[SweptJob], pictures: bool) -> dict[Path, Result]:
        """Run the jobs, and return a dictionary from each job's directory to its result."""
        if not jobs:
            return {}
        batches = in_batches([job.job for job in jobs], self._settings.max_batch_size)
        log.info(f"{self._directory}: jobs to run: {len(jobs):,}, batches: {len(batches):,}")
        if self._loggers is None:
            from fnnq_torchrl.training.loggers import Loggers  # after the checks: it is slow

            self._loggers = Loggers()
        if self._settings.cluster == "none":
            results = self._run_batches(batches, pictures=pictures, loggers=self._loggers)
        else:
            from fnnq_torchrl.launch.cluster import run_on_cluster

            folder = self._directory.absolute() / ".submitit"
            results = run_on_cluster(
                self._run_batches, batches, self._settings, folder, pictures=pictures
            )
        return {
            job.directory: result
            for batch, of_batch in zip(batches, results, strict=True)
            for job, result in zip(batch, of_batch, strict=True)
        }

    def _log(self) -> None:
        """Direct the log to the sweep's file; each job that Hydra runs redirects it to its own."""
        HydraConfig.instance().set_config(self._config)
        configure_log(self._config.hydra.hydra_logging, self._config.hydra.verbose)

    def _end(self, job: SweptJob, results: Mapping[Path, Result]) -> JobReturn:
        """Write the job's log, call the callbacks, and return what the sweeper expects of a job."""
        if job.directory in results:
            result = results[job.directory]
        else:
            from fnnq_torchrl.training.results import read_summary  # NumPy is slow to import

            result = read_summary(job.directory / "summary.json")["mean_score"]

        def outcome(_: DictConfig) -> Result:
            if not isinstance(result, Exception):
                return result
            failed = JobFailed(f"{job} failed: {result}")
            log.error(str(failed))
            if isinstance(result, JobFailed | OSError):
                raise failed from result
            raise result  # a bug keeps its traceback

        if self._context.callbacks.callbacks or isinstance(result, Exception):
            return run_job(  # slow; needed for callbacks and to log errors
                hydra_context=self._context,
                task_function=outcome,
                config=job.node(),
                job_dir_key="hydra.sweep.dir",
                job_subdir_key="hydra.sweep.subdir",
            )
        job.touch_logs()
        return JobReturn(
            overrides=job.task_overrides,
            working_dir=os.getcwd(),
            task_name=JobRuntime.instance().get("name"),
            status=JobStatus.COMPLETED,
            _return_value=result,
        )

    def _write_whole(self, first: int) -> None:
        """Write the tables of the sweep as a whole, and print one of jobs from ``first`` on."""
        from fnnq_torchrl.launch.sweep import write_sweep

        write_sweep(self._directory, self._results(), first)

    def _draw_whole(self) -> None:
        """Draw the curves of the sweep as a whole."""
        from fnnq_torchrl.launch.sweep import draw_whole

        draw_whole(self._directory, self._results())

    def _results(self) -> "list[SweptResult]":
        from fnnq_torchrl.launch.sweep import SweptResult
        from fnnq_torchrl.training.score import Score

        return [
            SweptResult(
                job.number,
                # Hydra escapes the colon of module:Class.
                {key_of(o): o.partition("=")[2].replace("\\:", ":") for o in job.overrides},
                job.directory,
                Score.of(job.config),
                JobRuns.of(job.config),
            )
            for job in self._jobs
        ]


def _draw(jobs: Sequence[SweptJob]) -> None:
    """Draw the learning curve of each of these finished jobs that has none."""
    for job in jobs:
        if not (job.directory / PICTURE).exists():
            from fnnq_torchrl.training.drawing import draw_job  # NumPy is slow to import

            draw_job(job.job)


def _check_directories(jobs: Sequence[SweptJob]) -> None:
    first: dict[Path, SweptJob] = {}
    for job in jobs:
        other = first.setdefault(job.directory, job)
        if other is not job:
            raise ConfigError(
                f"{job}: {job.directory} is also the directory of {other}; "
                "hydra.sweep.subdir must differ between jobs"
            )
