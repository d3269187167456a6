"""MLflow: an MLflow run for each job: curve, interval, configuration, tables, pictures, video.

TorchRL's MLFlowLogger isn't used: it sets the tracking server and the active run of the whole
process, sends a request for each step, and neither names its runs nor ends them.
"""

import logging
import math
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from urllib.request import url2pathname

# Before the import, which would start reporting the use of MLflow to its makers.
os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")

from mlflow.entities import Metric, Param
from mlflow.tracking import MlflowClient
from sqlalchemy.engine import URL, make_url

from fnnq_torchrl.config.checking import flat
from fnnq_torchrl.config.loggers import MlflowConfig
from fnnq_torchrl.files.atomic import alone_in

from .base import JobResults, Logger, Results, SweepResults

logging.getLogger("mlflow.store.db.utils").setLevel(logging.WARNING)  # logs every new database
logging.getLogger("urllib3.connectionpool").setLevel(logging.ERROR)  # logs every retry

_EXPERIMENT = "fnnq_torchrl"
"""The experiment if the user names none."""

_METRICS_AT_ONCE = 1000
"""The most metrics that MLflow takes in one call."""


class MlflowLogger(Logger):
    """A logger to an MLflow database beside the jobs, or to an MLflow server.

    Args:
        settings: the settings that ``conf/logger/mlflow.yaml`` explains.
    """

    def __init__(self, settings: MlflowConfig) -> None:
        self._uri = settings.tracking_uri or os.environ.get("MLFLOW_TRACKING_URI", "")
        self._experiment = settings.experiment
        # Removed from the environment, because this variable names a single MLflow run.
        self._run = os.environ.pop("MLFLOW_RUN_ID", None)
        # MLflow's defaults are two minutes and seven retries.
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", str(math.ceil(settings.timeout_s)))
        os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "1")

    def log_job(self, job: JobResults) -> None:
        now_ms = round(time.time() * 1000)
        situations = job.evaluations.situations.tolist()
        metrics = [
            Metric(name, value, now_ms, step)
            for name, column in job.curve.items()
            for value, step in zip(column, situations, strict=True)
        ]
        metrics += [
            Metric(name, value, now_ms, situations[-1]) for name, value in job.scores.items()
        ]
        params = [Param(name, str(value)) for name, value in flat(job.settings).items()]
        run, self._run = (self._run, None) if job.job.sweep is None else (None, self._run)
        self._log(job, params, metrics, run)

    def log_sweep(self, sweep: SweepResults) -> None:
        self._log(sweep, [], [])

    def _log(
        self,
        results: Results,
        params: Sequence[Param],
        metrics: Sequence[Metric],
        run: str | None = None,
    ) -> None:
        """Log a job or a sweep as one MLflow run, an existing one if its id is given."""
        uri = self._uri or _database(results.home.absolute() / "mlflow.db")
        with alone_in(results.home):  # two processes must not make the database at once
            client = MlflowClient(tracking_uri=uri)
            experiment = "" if run else _experiment(client, uri, self._experiment)
        key = run or _new_run(client, experiment, results)
        try:
            client.log_batch(key, params=params)
            for begin in range(0, len(metrics), _METRICS_AT_ONCE):
                client.log_batch(key, metrics[begin : begin + _METRICS_AT_ONCE])
            video = [] if results.video is None else [results.video]
            for file in results.pictures + results.tables + video:
                client.log_artifact(key, str(file))
        except BaseException:
            with suppress(Exception):  # the server may be gone; the first error is raised
                client.set_terminated(key, "FAILED")
            raise
        client.set_terminated(key)


def _new_run(client: MlflowClient, experiment: str, results: Results) -> str:
    tags = {"group": results.group}
    return client.create_run(experiment, tags=tags, run_name=results.name).info.run_id


def _database(path: Path) -> str:
    """Return the address of a database in a file.

    Raises:
        ValueError: if a name in the path isn't UTF-8, since MLflow would write elsewhere.
    """
    try:
        str(path).encode()
    except UnicodeEncodeError as error:
        raise ValueError(f"{str(path)!a}: the name of a directory isn't UTF-8") from error
    # The file's URI quotes the path, so that no letter of a name is read as part of the address.
    # MLflow would make directories with the quoted name if the address didn't name the driver.
    url = URL.create("sqlite+pysqlite", database=path.as_uri(), query={"uri": "true"})
    return url.render_as_string()


def _experiment(client: MlflowClient, uri: str, name: str) -> str:
    """Return the id of the experiment with this name; make the experiment if there is none.

    Args:
        client: the client of the database or the server.
        uri: the address of that.
        name: the name, or an empty text for the user's choice in MLflow's environment variables.
    """
    if not name and (chosen := os.environ.get("MLFLOW_EXPERIMENT_ID")):
        return chosen
    name = name or os.environ.get("MLFLOW_EXPERIMENT_NAME") or _EXPERIMENT
    if (found := client.get_experiment_by_name(name)) is not None:
        return found.experiment_id
    # Files beside the database; by default, MLflow puts them into the current directory.
    artifacts = None
    if uri.startswith("sqlite"):
        database = make_url(uri).database or ""
        path = Path(url2pathname(database.removeprefix("file://")))
        artifacts = (path.absolute().parent / "mlartifacts").as_uri()
    return client.create_experiment(name, artifact_location=artifacts)
