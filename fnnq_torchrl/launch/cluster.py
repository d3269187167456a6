"""Trains batches as tasks of a cluster, through submitit."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.config.launcher import LauncherConfig
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.batches import RunBatches
from fnnq_torchrl.training.jobs import Job, JobFailed, Result
from fnnq_torchrl.training.results import read_summary
from fnnq_torchrl.training.resume.interruptions import Interruptions
from fnnq_torchrl.training.terminal import announce

_SAVE_S = 60.0
"""The seconds that a save may take before the task is put back into the queue without it."""

_MOST_TIMEOUTS = 100
"""The number of time limits after which a task is no longer put back into the queue."""


class BatchTask:
    """The function that a task of the cluster calls; after a requeue, it is called again.

    Args:
        run_batches: the function that trains a batch.
        pictures: whether each job gets a ``learning_curve.png``.
    """

    def __init__(self, run_batches: RunBatches, pictures: bool) -> None:
        self._run_batches, self._pictures = run_batches, pictures
        self._interruptions: Interruptions | None = None  # made when training begins

    def __call__(self, batch: Sequence[Job]) -> list[Result]:
        """Train the unfinished jobs of the batch, and return the results of all its jobs.

        Raises:
            submitit.core.utils.UncompletedJobError: if the task reached its time limit more than
                `_MOST_TIMEOUTS` times.
        """
        from submitit.core.utils import UncompletedJobError

        results: dict[Path, Result] = {job.directory: _finished(job) for job in batch}
        missing = [job for job in batch if results[job.directory] is None]
        if not missing:
            return list(results.values())
        self._interruptions = Interruptions(missing[0].config.checkpoint.every_s)
        for new in self._run_batches(
            [missing], pictures=self._pictures, interruptions=self._interruptions
        ):
            for job, result in zip(missing, new, strict=True):
                if isinstance(result, UncompletedJobError):  # by submitit: the task ends
                    raise result
                results[job.directory] = result
        return list(results.values())

    def checkpoint(self, batch: Sequence[Job]) -> Any:
        """Save the training, and return the task that submitit puts back into the queue."""
        from submitit.helpers import DelayedSubmission

        if self._interruptions is not None:
            self._interruptions.save_now(_SAVE_S)
        return DelayedSubmission(BatchTask(self._run_batches, self._pictures), batch)


def run_on_cluster(
    run_batches: RunBatches,
    batches: Sequence[Sequence[Job]],
    settings: LauncherConfig,
    folder: Path,
    *,
    pictures: bool,
) -> Iterator[Sequence[Result]]:
    """Train each batch as one task of a job array, and yield the results.

    Args:
        run_batches: the function that trains a batch; cloudpickle must be able to pickle it.
        batches: the batches. The directories of their jobs must be visible to all nodes.
        settings: the cluster and the resources of each task.
        folder: the directory for submitit's files, which include the output of each task.
        pictures: whether each job gets a ``learning_curve.png``.

    Yields:
        The results of the jobs of a batch, batch after batch. If a task fails, its unfinished jobs
        have a `JobFailed` as their result.

    Raises:
        ConfigError: if submitit isn't installed, or the cluster's commands aren't found.
    """
    asked = f"hydra.launcher.cluster={settings.cluster}"
    try:
        import submitit

        executor = submitit.AutoExecutor(
            folder,
            cluster=settings.cluster,
            slurm_max_num_timeout=_MOST_TIMEOUTS,
            local_max_num_timeout=_MOST_TIMEOUTS,
        )
    except ImportError as error:
        raise ConfigError(f"{asked}: needs submitit; {installing('cluster')}") from error
    except RuntimeError as error:
        raise ConfigError(f"{asked}: {error}") from error
    executor.update_parameters(
        name="fnnq",
        timeout_min=settings.time_min,
        mem_gb=settings.memory_gb,
        cpus_per_task=settings.cpus,
        gpus_per_node=settings.gpus,
        **({"slurm_partition": settings.partition} if settings.partition else {}),
    )
    tasks = executor.map_array(BatchTask(run_batches, pictures), batches)
    names = ", ".join(task.job_id for task in tasks[:3]) + (", …" if len(tasks) > 3 else "")
    announce(f"{len(tasks):,} tasks on {settings.cluster}: {names}; their output is in {folder}")
    try:
        for task, batch in zip(tasks, batches, strict=True):
            try:
                results = task.result()
            except (submitit.core.utils.FailedJobError, submitit.core.utils.UncompletedJobError):
                why = JobFailed(f"task {task.job_id} failed; see {task.paths.stderr}")
                results = [why if (found := _finished(job)) is None else found for job in batch]
            yield results
    except KeyboardInterrupt:
        for task in tasks:
            task.cancel()
        raise


def _finished(job: Job) -> float | None:
    """Return the mean score from a job's summary.json, or None if the job isn't finished."""
    try:
        return read_summary(job.directory / "summary.json")["mean_score"]
    except (FileNotFoundError, ValueError):  # no summary.json, or a damaged one
        return None
