"""What runs the jobs of a Hydra multirun; the plugin itself is ``hydra_plugins/fnnq_torchrl.py``.

Each job has what Hydra promises: its own directory with ``.hydra``, log and result files, and its
return value. What is trained is a batch of all jobs that differ only in per-run values.
"""

import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import (
    JobReturn,
    JobRuntime,
    JobStatus,
    configure_log,
    env_override,
    run_job,
    setup_globals,
)
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig

from envs.core.parameters import check
from fnnq_torchrl.config.launcher import LauncherConfig
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.batches import in_batches
from fnnq_torchrl.launch.composition import key_of
from fnnq_torchrl.launch.swept_jobs import SweptJob, compose_jobs
from fnnq_torchrl.training.jobs import JobFailed, Result

log = logging.getLogger(__name__)


class Multirun:
    """The jobs of one command with ``-m``, as many as its sweeper comes up with.

    Args:
        settings: of ``conf/hydra/launcher/batch.yaml``.
        context: Hydra's.
        task_function: the command's; its attribute ``run_batches`` is what trains, and to
            ``at_end`` is added what is to be done when there are no more jobs
            (see :func:`fnnq_torchrl.launch.command.command`).
        config: of the multirun itself.

    Raises:
        ConfigError: a setting isn't allowed.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        context: HydraContext,
        task_function: TaskFunction,
        config: DictConfig,
    ) -> None:
        self._settings = LauncherConfig(**settings)
        check(self._settings, "hydra.launcher.")
        self._context, self._config = context, config
        self._run_batches = task_function.run_batches  # type: ignore[attr-defined]
        task_function.at_end.append(self._log_whole)  # type: ignore[attr-defined]
        self._jobs: list[SweptJob] = []
        self._anything_new = False

    def launch(self, job_overrides: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run some more jobs, those that aren't finished already.

        Args:
            job_overrides: of each.
            first: the number of the first.

        Raises:
            ConfigError: a job isn't valid, or its directory is another's; nothing has run.
        """
        setup_globals()
        self._log()
        jobs = compose_jobs(self._context.config_loader, self._config, job_overrides, first)
        _check_directories([*self._jobs, *jobs])
        missing = []
        for job in jobs:
            if job.is_finished():
                job.clear()
            else:
                missing.append(job)
        if len(missing) < len(jobs):
            log.info(f"finished already: {len(jobs) - len(missing):,} of {len(jobs):,} jobs")
        for job in missing:
            job.write_configuration()
        with env_override(self._config.hydra.job.env_set):
            results = self._run(missing, pictures=len(jobs) <= self._settings.pictures_up_to)
        returns = [self._end(job, _result(job, results)) for job in jobs]
        self._log()
        self._jobs += jobs
        self._write_whole()
        self._anything_new |= bool(missing)
        return returns

    def _run(self, jobs: Sequence[SweptJob], pictures: bool) -> dict[Path, Result]:
        """The results by the jobs' directories."""
        if not jobs:
            return {}
        batches = in_batches([job.job for job in jobs], self._settings.max_batch_size)
        log.info(f"jobs to run: {len(jobs):,}, batches: {len(batches):,}")
        if self._settings.cluster == "none":
            results = self._run_batches(batches, pictures=pictures)
        else:
            from fnnq_torchrl.launch.cluster import run_on_cluster

            folder = Path(self._config.hydra.sweep.dir).absolute() / ".submitit"
            results = run_on_cluster(
                self._run_batches, batches, self._settings, folder, pictures=pictures
            )
        return {
            job.directory: result
            for batch, of_batch in zip(batches, results, strict=True)
            for job, result in zip(batch, of_batch, strict=True)
        }

    def _log(self) -> None:
        """Log as the sweep does: jobs that Hydra ran log into their own files."""
        HydraConfig.instance().set_config(self._config)
        configure_log(self._config.hydra.hydra_logging, self._config.hydra.verbose)

    def _end(self, job: SweptJob, result: Result) -> JobReturn:
        """The job's log, the callbacks, and what the sweeper gets."""
        if self._context.callbacks.callbacks or isinstance(result, Exception):

            def outcome(_: DictConfig) -> Result:
                return _told(job, result)

            return run_job(  # Hydra's own way, which takes its time
                hydra_context=self._context,
                task_function=outcome,
                config=job.node(),
                job_dir_key="hydra.sweep.dir",
                job_subdir_key="hydra.sweep.subdir",
            )
        job.touch_logs()
        end = JobReturn(
            overrides=job.task_overrides,
            working_dir=os.getcwd(),
            task_name=JobRuntime.instance().get("name"),
            status=JobStatus.COMPLETED,
        )
        end.return_value = result
        return end

    def _write_whole(self) -> None:
        """The sweep's own files, over all of its jobs so far."""
        from fnnq_torchrl.launch.sweep import SweptResult, write_sweep

        results = [
            SweptResult(
                job.number,
                {key_of(line): line.partition("=")[2] for line in job.overrides},
                job.directory,
                best=len(job.config.evaluation.situations),
            )
            for job in self._jobs
        ]
        try:
            write_sweep(Path(self._config.hydra.sweep.dir), results)
        except ValueError as error:
            raise _damaged(error) from error

    def _log_whole(self) -> None:
        """What the loggers of its jobs have on the sweep as a whole, unless it was there before."""
        if not self._anything_new:
            return
        from fnnq_torchrl.training.loggers import Loggers, SweepResults

        directory = Path(self._config.hydra.sweep.dir).absolute()
        for config in {repr(job.config.logger): job.config.logger for job in self._jobs}.values():
            Loggers.of(config).log_sweep(SweepResults(directory, len(self._jobs)))


def _damaged(error: ValueError) -> JobFailed:
    """Of a result file that a finished job left."""
    return JobFailed(f"{error}; without its summary.json, the job is computed again")


def _check_directories(jobs: Sequence[SweptJob]) -> None:
    first: dict[Path, SweptJob] = {}
    for job in jobs:
        other = first.setdefault(job.directory, job)
        if other is not job:
            raise ConfigError(
                f"{job}: {job.directory} is that of {other} too; "
                "hydra.sweep.subdir must tell them apart"
            )


def _result(job: SweptJob, results: Mapping[Path, Result]) -> Result:
    """What came of the job just now or, if it was finished before, then."""
    if job.directory in results:
        return results[job.directory]
    from fnnq_torchrl.training.results import (
        read_summary,  # not before the checks: scipy takes a second
    )

    try:
        return read_summary(job.directory / "summary.json")["mean_score"]
    except ValueError as error:
        raise _damaged(error) from error


def _told(job: SweptJob, result: Result) -> Result:
    """What the job's own function would return or raise."""
    if not isinstance(result, Exception):
        return result
    failed = JobFailed(f"{job} failed: {result}")
    log.error(str(failed))
    if isinstance(result, JobFailed | OSError):
        raise failed from result
    raise result  # a bug keeps its traceback
