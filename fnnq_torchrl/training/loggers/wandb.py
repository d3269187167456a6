"""Weights & Biases: one wandb run for each job, for each run of a job, or for a whole sweep.

TorchRL's WandbLogger isn't used: it calls `wandb.init`, but has no methods for tables, pictures,
files, time limits and the end of a run.
"""

import csv
import logging
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import wandb
from wandb.errors import AuthenticationError, CommError
from wandb.sdk.lib import wbauth

from fnnq_torchrl.config.identity import JobRuns, RunsSoFar
from fnnq_torchrl.config.loggers import WandbConfig
from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.results import best_run
from fnnq_torchrl.training.terminal import announce

from .base import JobResults, Logger, Results, SweepResults

logging.getLogger("wandb").setLevel(logging.WARNING)  # logs every run

_AT_ONCE = 8
"""The number of wandb runs logged at the same time; each waits for the server twice."""

_RUN_S = 0.05
"""The seconds that logging a wandb run takes (benchmarks/loggers.py)."""

_MANY = 100
"""The number of wandb runs above which a line says how long logging them takes."""

_PROJECT = "fnnq_torchrl"
"""The project if the user names none."""

_OF_ONE_RUN = {
    "WANDB_RUN_ID": "run_id",
    "WANDB_NAME": "run_name",
    "WANDB_RESUME": "resume",
    "WANDB_SWEEP_ID": "sweep_id",
    "WANDB_SWEEP_PARAM_PATH": "sweep_param_path",
}
"""The environment variables that describe a single wandb run, and wandb's settings for them.

A sweep agent of wandb sets them for the run that it starts.
"""

_OLD_MODES = {"dryrun": "offline", "run": "online"}
"""The old names of modes that wandb still accepts, and their present names."""


class WandbLogger(Logger):
    """A logger to wandb's server or, without a login or a server, to files beside the jobs.

    Args:
        settings: the settings that ``conf/logger/wandb.yaml`` explains.

    Raises:
        ConfigError: if the mode is ``online``, and nobody is logged in; or if one of wandb's
            environment variables is wrong.
    """

    def __init__(self, settings: WandbConfig) -> None:
        self._settings = settings
        # Removed from the environment, because wandb would use them for all runs of this process.
        found = {each: os.environ.pop(name, None) for name, each in _OF_ONE_RUN.items()}
        self._own = {each: value for each, value in found.items() if value}
        self._mode = _mode(settings.mode)
        self._users = wandb.setup().settings  # from the environment and wandb's files
        self._logged = RunsSoFar()

    def prepare(self, jobs: Sequence[Job]) -> None:
        if self._mode == "disabled":
            return
        per = self._settings.per
        if per == "sweep" and any(job.config.logger.video and job.sweep for job in jobs):
            announce("wandb: no videos, since logger.wandb.per=sweep logs no jobs of a sweep")
        runs = len(jobs) if per == "job" else sum(job.config.num_seeds for job in jobs)
        if runs > _MANY and per != "sweep":
            fewer = "job" if runs > len(jobs) else "sweep"
            announce(
                f"wandb: {runs:,} wandb runs, which take about {runs * _RUN_S:.0f} s to log; "
                f"logger.wandb.per={fewer} makes fewer"
            )

    def log_job(self, job: JobResults) -> None:
        if self._mode == "disabled":
            return
        if self._settings.per == "run":
            identities = JobRuns.of(job.job.config)
            new = {*self._logged.add(identities)}
            columns = Runs.of([job.job.config]).columns
            values = {key: column.tolist() for key, column in columns.items()}
            with ThreadPoolExecutor(_AT_ONCE) as pool:
                runs = [run for run, seed in enumerate(identities.seeds) if seed in new]
                [*pool.map(lambda run: self._log_run(job, values, run), runs)]
        elif self._settings.per == "job" or job.job.sweep is None:
            self._log_whole(job)

    def log_sweep(self, sweep: SweepResults) -> None:
        if self._mode == "disabled":
            return
        is_only = self._settings.per == "sweep"
        with self._wandb_run(sweep, sweep.name, {}, is_only, job_type="sweep") as log:
            log.log(_images(sweep.pictures) | {"jobs": _table_of(sweep.directory / "summary.csv")})
            _save(log, sweep.tables)

    def close(self) -> None:
        """Wait until wandb's background process ends; at exit, a failure would print a traceback.

        Raises:
            OSError: if the process has ended with an error status.
        """
        try:
            wandb.teardown()
        except SystemExit as end:
            raise OSError(f"its process has ended with status {end.code}") from end

    def _log_run(self, job: JobResults, values: dict[str, list[float]], run: int) -> None:
        """Log one run of a job.

        The first run gets the job's pictures, and the best run the video, in which it drives.
        """
        config = job.settings | {key: column[run] for key, column in values.items()}
        del config["num_seeds"]
        name = f"seed={config['seed']} lam={config['lam']:g}"
        is_only = job.job.sweep is None and job.evaluations.runs == 1
        with self._wandb_run(job, name, config, is_only) as log:
            _log_rows(log, job.columns(run))
            for key in ("mean_score", "final_score"):
                log.summary[key] = float(getattr(job.evaluations, key)[run])
            shown = _images(job.pictures) if run == 0 else {}
            shown |= _video(job) if run == best_run(job.evaluations) else {}
            if shown:
                log.log(shown)

    def _log_whole(self, job: JobResults) -> None:
        """Log a job's learning curve with its interval, and a table of its runs."""
        situations = job.evaluations.situations.tolist()
        score = {name: column for name, column in job.curve.items() if name.startswith("score")}
        with self._wandb_run(job, job.name, job.settings, job.job.sweep is None) as log:
            _log_rows(log, {"situations": situations} | job.curve)
            band = wandb.plot.line_series(
                situations, [*score.values()], [*score], "score", "situations"
            )
            charts = {"each run": _runs_table(job), "score with its interval": band}
            log.log(_images(job.pictures) | _video(job) | charts)
            log.summary.update(dict(job.summary))
            _save(log, job.tables)

    @contextmanager
    def _wandb_run(
        self,
        results: Results,
        name: str,
        config: Mapping[str, Any],
        is_only: bool,
        job_type: str = "train",
    ) -> Iterator[wandb.Run]:
        """Return a wandb run for a block; the only one of a command has the user's id and name."""
        settings, users = self._settings, self._users
        own: dict[str, Any] = {"run_name": name}
        if is_only:
            own |= self._own
            self._own = {}
        log = self._init(
            dir=results.directory,
            project=settings.project or users.project or _PROJECT,
            entity=settings.entity or None,
            group=settings.group or users.run_group or results.group,
            job_type=settings.job_type or users.run_job_type or job_type,
            tags=settings.tags or None,
            config=dict(config),
            reinit="create_new",  # by default, two runs at once become one
            settings=wandb.Settings(
                silent=True,
                console="off",
                x_disable_stats=True,  # statistics of the machine, which has finished learning
                x_save_requirements=False,  # reading the requirements takes as long as all the rest
                init_timeout=settings.timeout_s,
                finish_timeout=settings.timeout_s,
                finish_timeout_raises=True,
                **own,
            ),
        )
        try:  # not `with log`, which prints a traceback
            yield log
        except BaseException:
            log.finish(exit_code=1)
            raise
        try:
            log.finish()
        except TimeoutError as error:
            self._go_offline(error)

    def _init(self, **arguments: Any) -> wandb.Run:
        """Begin a wandb run, offline if the server can't be used."""
        try:
            return wandb.init(mode=self._mode, **arguments)
        except CommError as error:  # no answer, or a refused login
            self._go_offline(error)
            return wandb.init(mode="offline", **arguments)

    def _go_offline(self, error: Exception) -> None:
        if self._mode != "offline":
            self._mode = "offline"
            reason = str(error).partition("\n")[0]
            announce(f"wandb: logs offline from now on, for `wandb sync` to upload later: {reason}")


def _mode(asked: str) -> Any:
    """Return wandb's mode: the user's choice in our configuration or else in wandb's own.

    If neither has one, the mode is online for a user who is logged in. Otherwise it is offline, and
    a line says so. This function asks no question and doesn't use the network.

    Raises:
        ConfigError: for the reasons that `WandbLogger` lists.
    """
    try:
        settings = wandb.setup().settings
        logged_in = wbauth.authenticate_session(
            host=settings.base_url, source="fnnq_torchrl", prompt=False, update_session=False
        )
    except (AuthenticationError, ValueError) as error:
        raise ConfigError(f"logger=wandb: {error}") from error
    key, mode = "logger.wandb.mode", asked
    if asked == "auto":
        key, mode = "WANDB_MODE", os.environ.get("WANDB_MODE", "")
    mode = _OLD_MODES.get(mode, mode)
    if mode == "online" and not logged_in:
        raise ConfigError(
            f"{key}=online: nobody is logged in; run `wandb login` or set WANDB_API_KEY"
        )
    if not mode and settings.mode != "online":  # "online" may be just the default
        mode = settings.mode  # set by `wandb offline`
    if not mode and not logged_in:
        announce("wandb: nobody is logged in, so it logs offline; `wandb sync` uploads it later")
    return mode or ("online" if logged_in else "offline")


def _log_rows(log: wandb.Run, columns: Mapping[str, Sequence[float]]) -> None:
    log.define_metric("*", step_metric="situations")
    for row in zip(*columns.values(), strict=True):
        values = dict(zip(columns, row, strict=True))
        log.log(values, step=int(values["situations"]))


def _images(pictures: Iterable[Path]) -> dict[str, Any]:
    return {picture.stem: wandb.Image(str(picture)) for picture in pictures}


def _video(job: JobResults) -> dict[str, Any]:
    if job.video is None:
        return {}
    return {job.video.stem: wandb.Video(str(job.video), format="gif")}


def _runs_table(job: JobResults) -> wandb.Table:
    """Return a table with a row for each run of a job: its seed and its results.

    The table has no configuration, since the runs of a job differ only in their seeds.
    """
    evaluations = job.evaluations
    columns = {
        "seed": evaluations.seed,
        "steps": evaluations.steps[:, -1],
        "diverged": evaluations.diverged[:, -1],
        "mean_score": evaluations.mean_score,
        "final_score": evaluations.final_score,
    }
    table = wandb.Table(columns=[], data=[])
    for name, column in columns.items():  # several times faster than adding rows
        table.add_column(name, column.tolist())
    return table


def _table_of(path: Path) -> wandb.Table:
    """Return a CSV file as a table; numeric cells become numbers, and empty cells None."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    data = [[_number(cell) for cell in row] for row in rows]
    return wandb.Table(columns=[*header], data=data, allow_mixed_types=True)


def _number(cell: str) -> float | str | None:
    try:
        return float(cell) if cell else None
    except ValueError:
        return cell


def _save(log: wandb.Run, files: Iterable[Path]) -> None:
    for path in files:
        # A copy, since wandb links files from other directories and prints a warning.
        copy = shutil.copy(path, log.dir)
        log.save(copy, base_path=log.dir, policy="end")
