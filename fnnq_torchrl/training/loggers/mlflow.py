"""MLflow: one MLflow run for each job, with its curve and band, configuration, tables and pictures.

Not by TorchRL's MLFlowLogger, which sends a number at a time, sets the tracking server and the
active run of the whole process, and never ends a run.
"""

import logging
import math
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

# Before the import: MLflow would report its use to its makers.
os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")

from mlflow.entities import Metric, Param
from mlflow.exceptions import MlflowException
from mlflow.tracking import MlflowClient

from fnnq_torchrl.config.loggers import MlflowConfig
from fnnq_torchrl.config.schema import flat
from fnnq_torchrl.files.atomic import alone_in

from .base import JobResults, Logger, SweepResults

logging.getLogger("mlflow.store.db.utils").setLevel(logging.WARNING)  # it tells of each database
logging.getLogger("urllib3.connectionpool").setLevel(logging.ERROR)  # a lost server is told once

_METRICS_AT_ONCE = 1000
"""That MLflow takes in one call."""

_PARAM_LETTERS = 6000
"""That MLflow keeps of a value."""


class MlflowLogger(Logger):
    """See `fnnq_torchrl.training.loggers.Logger`.

    Args:
        settings: see ``conf/logger/mlflow.yaml``.
    """

    def __init__(self, settings: MlflowConfig) -> None:
        self._uri = settings.tracking_uri or os.environ.get("MLFLOW_TRACKING_URI", "")
        self._experiment = settings.experiment
        # MLflow's own would be two minutes, seven times over.
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", str(math.ceil(settings.timeout_s)))
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "1")

    def log_job(self, job: JobResults) -> None:
        settings = [
            Param(key, str(value)[:_PARAM_LETTERS]) for key, value in flat(job.settings).items()
        ]
        situations = job.evaluations.situations.tolist()
        metrics = [
            (name, value, after)
            for name, column in job.curve.items()
            for value, after in zip(column.tolist(), situations, strict=True)
        ]
        metrics += [(name, value, situations[-1]) for name, value in job.scores.items()]
        home, tags = job.job.sweep or job.directory, {"group": job.group}
        self._log(home, job.name, tags, settings, metrics, job.pictures + job.tables)

    def log_sweep(self, sweep: SweepResults) -> None:
        directory = sweep.directory
        name, tags = f"{directory.name}: {sweep.jobs:,} jobs", {"group": directory.name}
        self._log(directory, name, tags, [], [], sweep.pictures + sweep.tables)

    def _log(
        self,
        home: Path,
        name: str,
        tags: dict[str, str],
        settings: Sequence[Param],
        metrics: Sequence[tuple[str, float, int]],
        files: Sequence[Path],
    ) -> None:
        """One MLflow run.

        Args:
            home: the directory for the database, where no other is given.
            name: of the run.
            tags: of the run.
            settings: the configuration.
            metrics: each a name, a value, and the learning situations before it.
            files: to be kept with it.
        """
        uri = self._uri or f"sqlite:///{home.absolute() / 'mlflow.db'}"
        with alone_in(home):  # of several processes on a new database, one makes its tables
            client = MlflowClient(tracking_uri=uri)
            experiment = _experiment(client, uri, self._experiment)
        run = client.create_run(experiment, tags=tags, run_name=name)
        key = run.info.run_id
        now_ms = run.info.start_time
        try:
            client.log_batch(key, params=settings)
            for begin in range(0, len(metrics), _METRICS_AT_ONCE):
                some = metrics[begin : begin + _METRICS_AT_ONCE]
                client.log_batch(key, [Metric(of, value, now_ms, step) for of, value, step in some])
            for file in files:
                client.log_artifact(key, str(file))
        except BaseException:
            with suppress(Exception):  # its server may be gone; what it was is told
                client.set_terminated(key, "FAILED")
            raise
        client.set_terminated(key)


def _experiment(client: MlflowClient, uri: str, name: str) -> str:
    """The id of the experiment, which is made if it isn't there."""
    if (found := client.get_experiment_by_name(name)) is not None:
        return found.experiment_id
    # Beside the database; MLflow's own default is the directory that the command runs in.
    _, is_sqlite, path = uri.partition("sqlite:///")
    artifacts = (Path(path).absolute().parent / "mlartifacts").as_uri() if is_sqlite else None
    try:
        return client.create_experiment(name, artifact_location=artifacts)
    except MlflowException:  # on a server, somebody else may just have made it
        if (found := client.get_experiment_by_name(name)) is None:
            raise
        return found.experiment_id
