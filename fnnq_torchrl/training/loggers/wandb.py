"""Weights & Biases: one wandb run for each job, for each run of it, or for the whole sweep.

Not by TorchRL's WandbLogger, whose ``offline=True`` sets WANDB_MODE for the whole process, which
begins to write before that, and which knows one run at a time.
"""

import csv
import logging
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import wandb
from wandb.errors import AuthenticationError, CommError
from wandb.sdk.lib import wbauth

from fnnq_torchrl.config.loggers import WandbConfig
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.terminal import announce

from .base import JobResults, Logger, SweepResults
from .wandb_file import is_whole

logging.getLogger("wandb").setLevel(logging.WARNING)  # what it does is of no interest, run by run

_AT_ONCE = 8
"""Wandb runs that are logged side by side, since each mostly waits for wandb's own process."""

_RUN_S = 0.05
"""Seconds that a wandb run takes (benchmarks/loggers.py)."""

_MANY = 100
"""Wandb runs from which on the user should know how long they take."""

_MOST_ROWS = wandb.Table.MAX_ROWS
"""Of a table, which wandb would cut there."""


class WandbLogger(Logger):
    """See `fnnq_torchrl.training.loggers.Logger`.

    Args:
        settings: see ``conf/logger/wandb.yaml``.

    Raises:
        ConfigError: it is to log online, and nobody is logged in; or wandb's own settings, of the
            environment, are wrong.
    """

    def __init__(self, settings: WandbConfig) -> None:
        self._settings = settings
        self._mode, self._asked_for = _mode(settings.mode)
        self._told: set[str] = set()
        self._logged: set[tuple[Path, int]] = set()  # single runs, by their job
        self._offline: set[Path] = set()  # the directories of wandb runs that are on the disk only

    def foresee(self, jobs: Sequence[Job]) -> None:
        if not self._asked_for:
            self._tell_once(
                "wandb: nobody is logged in, so it logs offline; `wandb sync` uploads it later"
            )
        runs = (
            len(jobs) if self._settings.per == "job" else sum(job.config.num_seeds for job in jobs)
        )
        if runs > _MANY and self._settings.per != "sweep":
            fewer = "job" if runs > len(jobs) else "sweep"
            self._tell_once(
                f"wandb: {runs:,} wandb runs, which take about {runs * _RUN_S:.0f} s to log; "
                f"logger.wandb.per={fewer} makes fewer"
            )

    def _tell_once(self, line: str) -> None:
        if line not in self._told:  # by an earlier batch of the same sweep
            self._told.add(line)
            announce(line)

    def log_job(self, job: JobResults) -> None:
        self._online_or_not(lambda: self._log_job(job))

    def log_sweep(self, sweep: SweepResults) -> None:
        self._online_or_not(lambda: self._log_sweep(sweep))

    def close(self) -> None:
        """Wait for wandb's process to write all that it was given, and look whether it could.

        Raises:
            OSError: it couldn't, of which it says nothing itself.
        """
        wandb.teardown()
        files = sorted(file for directory in self._offline for file in directory.glob("*.wandb"))
        cut = [file for file in files if not is_whole(file)]
        self._offline.clear()
        if cut:
            raise OSError(f"{len(cut):,} of its {len(files):,} files are cut short, as {cut[0]}")

    def _online_or_not(self, log: Callable[[], None]) -> None:
        """Log offline what can't be logged online."""
        try:
            log()
        except CommError as error:
            if self._mode != "online":
                raise
            self._mode = "offline"
            reason = str(error).partition("\n")[0]
            refused = isinstance(error, AuthenticationError)
            words = "is refused by" if refused else "can't reach"
            announce(f"wandb: {words} its server, so it logs offline from now on: {reason}")
            log()
        except Exception:
            with suppress(Exception):  # else that comes at the exit, with a traceback
                wandb.teardown()
            raise

    def _log_job(self, job: JobResults) -> None:
        if self._settings.per == "run":
            with ThreadPoolExecutor(_AT_ONCE) as pool:
                list(pool.map(lambda run: self._log_run(job, run), range(job.evaluations.runs)))
        elif self._settings.per == "job" or job.job.sweep is None:
            self._log_whole(job)

    def _log_run(self, job: JobResults, run: int) -> None:
        """One run of a job, with the job's pictures if it is the first."""
        if (job.directory, run) in self._logged:  # before the server was lost
            return
        values = {key: column[run] for key, column in job.runs.items()}
        config = job.settings | values
        del config["num_seeds"]
        name = f"seed={values['seed']} lam={values['lam']:g}"
        evaluations = job.evaluations
        with self._wandb_run(job.directory, job.group, name, config) as log:
            _log_rows(log, list(job.rows(run)))
            for key in ("mean_score", "final_score"):
                log.summary[key] = float(getattr(evaluations, key)[run])
            if run == 0:
                log.log(_images(job.pictures))
        self._logged.add((job.directory, run))

    def _log_whole(self, job: JobResults) -> None:
        """A job's learning curve with its band, and its runs in a table."""
        situations, curve = job.evaluations.situations.tolist(), job.curve
        columns = {"situations": situations} | {key: of.tolist() for key, of in curve.items()}
        bounds = {key: columns[key] for key in columns if key.startswith("score")}
        with self._wandb_run(job.directory, job.group, job.name, job.settings) as log:
            rows = zip(*columns.values(), strict=True)
            _log_rows(log, [dict(zip(columns, row, strict=True)) for row in rows])
            log.log(
                _images(job.pictures)
                | {
                    "each run": _runs_table(job),
                    "score with its interval": wandb.plot.line_series(
                        situations, list(bounds.values()), list(bounds), "score", "situations"
                    ),
                }
            )
            log.summary.update(dict(job.summary))
            _save(log, job.tables)

    def _log_sweep(self, sweep: SweepResults) -> None:
        directory = sweep.directory
        name = f"{directory.name}: {sweep.jobs:,} jobs"
        with self._wandb_run(directory, directory.name, name, {}, job_type="sweep") as log:
            table = {"jobs": _table_of(directory / "summary.csv")}
            log.log(_images(sweep.pictures) | table)
            _save(log, sweep.tables)

    @contextmanager
    def _wandb_run(
        self, directory: Path, group: str, name: str, config: Mapping[str, Any], job_type: str = ""
    ) -> Iterator[wandb.Run]:
        settings = self._settings
        log = wandb.init(
            mode=self._mode,
            dir=directory,
            project=settings.project,
            entity=settings.entity or None,
            group=settings.group or group,
            job_type=job_type or settings.job_type,
            tags=settings.tags,
            name=name,
            config=dict(config),
            reinit="create_new",  # without it, what is one run too many goes to the first
            settings=wandb.Settings(
                silent=True,
                console="off",
                x_disable_stats=True,  # of the machine, which isn't learning any more
                x_save_requirements=False,  # reading them takes as long as all the rest
                init_timeout=settings.timeout_s,
                finish_timeout=settings.timeout_s,
                finish_timeout_raises=True,
            ),
        )
        if self._mode == "offline":
            self._offline.add(Path(log.dir).parent)
        try:  # and not `with`, since wandb's prints a traceback
            yield log
        except BaseException:
            log.finish(exit_code=1)
            raise
        try:
            log.finish()
        except TimeoutError:
            self._mode = "offline"
            self._tell_once(
                f"wandb: its server took longer than {settings.timeout_s:g} s, so it logs offline "
                "from now on; `wandb sync` uploads what is missing"
            )


def _mode(asked: str) -> tuple[Any, bool]:
    """Wandb's mode, and whether somebody has asked for it or is logged in.

    Nothing is asked and nothing goes over the network.
    """
    try:
        settings = wandb.setup().settings
        logged_in = wbauth.authenticate_session(
            host=settings.base_url, source="fnnq_torchrl", prompt=False, update_session=False
        )
    except (AuthenticationError, ValueError) as error:
        raise ConfigError(f"logger=wandb: {error}") from error
    given: str | None = asked
    if asked == "auto":
        # What `wandb offline` has set; what nobody has set is online, too.
        of_settings = None if settings.mode == "online" else settings.mode
        given = os.environ.get("WANDB_MODE") or of_settings
    if given == "online" and not logged_in:
        key = "logger.wandb.mode" if asked == given else "WANDB_MODE"
        raise ConfigError(
            f"{key}=online: nobody is logged in; `wandb login` or WANDB_API_KEY do that"
        )
    return given or ("online" if logged_in else "offline"), bool(given or logged_in)


def _log_rows(log: wandb.Run, rows: Sequence[Mapping[str, float]]) -> None:
    log.define_metric("*", step_metric="situations")
    for row in rows:
        log.log(dict(row), step=int(row["situations"]))


def _images(pictures: Sequence[Path]) -> dict[str, Any]:
    return {picture.stem: wandb.Image(str(picture)) for picture in pictures}


def _runs_table(job: JobResults) -> wandb.Table:
    """A row for each run: its seed, which is all that it has of its own, and what came of it."""
    evaluations = job.evaluations
    columns = {
        "seed": evaluations.seed,
        "steps": evaluations.steps[:, -1],
        "diverged": evaluations.diverged[:, -1],
        "denormal": evaluations.denormal[:, -1],
        "mean_score": evaluations.mean_score,
        "final_score": evaluations.final_score,
    }
    table = wandb.Table(columns=[], data=[])
    for name, column in columns.items():  # which wandb takes several times faster than rows
        table.add_column(name, column[:_MOST_ROWS].tolist())
    return table


def _table_of(path: Path) -> wandb.Table:
    """A CSV file, its numbers as numbers."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    data = [[_number(cell) for cell in row] for row in rows[:_MOST_ROWS]]
    return wandb.Table(columns=[*header], data=data, allow_mixed_types=True)


def _number(cell: str) -> float | str | None:
    try:
        return float(cell) if cell else None
    except ValueError:
        return cell


def _save(log: wandb.Run, files: Sequence[Path]) -> None:
    for path in files:
        # A copy, since wandb warns of the links that it would make.
        copy = shutil.copy(path, log.dir)
        log.save(copy, base_path=log.dir, policy="end")
