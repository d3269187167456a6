"""The form of every command: Hydra's command line in, a valid `Config` out, errors in one line."""

import errno
import logging
import os
import re
import shlex
import signal
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn

from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn
from hydra.errors import HydraException
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig, OmegaConf

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.launch.application import Application
from fnnq_torchrl.launch.batches import RunBatches
from fnnq_torchrl.launch.composition import explain, key_of
from fnnq_torchrl.launch.directories import OutputDirectory
from fnnq_torchrl.launch.flags import hydra_arguments
from fnnq_torchrl.launch.from_job import choose_primary
from fnnq_torchrl.launch.help import help_page
from fnnq_torchrl.launch.launcher import Multirun
from fnnq_torchrl.training.jobs import JobFailed
from fnnq_torchrl.training.resume.interruptions import SAVING, Interrupted
from hydra_plugins.fnnq_torchrl import BatchLauncher, BatchSweeper

_FULL_ERROR = "HYDRA_FULL_ERROR"
"""The variable that asks for Hydra's errors as they are, with their tracebacks."""

_OF_DISKS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EPIPE}

_PLACES = ("hydra.run.dir", "hydra.sweep.dir")
"""The keys of the directory of a job, and of a sweep."""

RunJob = Callable[[Config, Path], float | None]
"""Does a job, and returns its value for a sweeper."""


class Task:
    """What Hydra calls to do the work of a command: one job, or the jobs of a multirun.

    Args:
        job: does one job.
        run_batches: does the jobs of a multirun.

    Attributes:
        began: whether the work has begun. An error after that is not a mistake in what the user
            typed.
        again: the command that resumes the work after an interruption; empty until it is known.
    """

    def __init__(self, job: RunJob, run_batches: RunBatches) -> None:
        self._job, self._run_batches = job, run_batches
        self._multirun: Multirun | None = None
        self.began, self.again = False, ""

    def __call__(self, node: DictConfig) -> float | None:
        """Do one job, and return its value for a sweeper."""
        with errors_in_one_line(self):  # outside, Hydra would add a line of its own
            config = to_config(node, own=True)
            directory = Path(HydraConfig.get().runtime.output_dir)
            self.began = True
            return self._job(config, directory)

    def set_up(
        self, settings: Mapping[str, Any], context: HydraContext, config: DictConfig
    ) -> None:
        """Prepare for a multirun. The arguments are those of `Multirun`."""
        self._multirun = Multirun(settings, context, config, self._run_batches)

    def launch(self, job_overrides: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run some more jobs of the multirun: see `Multirun.launch`."""
        assert self._multirun is not None
        self.began = True
        return self._multirun.launch(job_overrides, first)

    def end(self) -> None:
        """Finish the multirun, if it is one. No sweeper says which of its launches is the last."""
        if self._multirun is not None:
            self._multirun.end()


def command(job: RunJob, run_batches: RunBatches) -> Callable[[], None]:
    """Return the command that does a job, or the jobs of a sweep.

    A mistake in the configuration, or any `ConfigError` of the job, is one line on stderr and exit
    status 2; a job that failed, or a file that can't be read or written, is one line and status 1;
    Ctrl-C is status 130, another signal 128 and its number; every other exception keeps its
    traceback. A user who sets HYDRA_FULL_ERROR=1 gets Hydra's own errors with theirs.

    Args:
        job: takes the configuration and the directory, which exists, for what it writes. What it
            returns is the job's value for a sweeper.
        run_batches: does the same for batches of jobs at once; yields the results of each batch
            (see :func:`fnnq_torchrl.training.job.run_batches`).

    Returns:
        A function without arguments that reads ``sys.argv``: one job, or those of a sweep with
        ``-m``.
    """
    for plugin in (BatchLauncher, BatchSweeper):  # Hydra doesn't find them in every installation
        Plugins.instance().register(plugin)

    def main() -> None:
        task, full = Task(job, run_batches), os.environ.get(_FULL_ERROR) == "1"
        with nullcontext() if full else errors_in_one_line(task):
            _run(task, full)

    return main


def _run(task: Task, full: bool) -> None:
    """Do what is typed.

    Args:
        task: for Hydra to call.
        full: Hydra's errors are raised as they are.
    """
    given = hydra_arguments(sys.argv[1:])
    if given.help or given.version:
        page = help_page() if given.help else f"fnnq_torchrl {version('fnnq_torchrl')}\n"
        sys.stdout.write(page)
        return
    if given.experimental_rerun is not None:
        raise ConfigError(
            "--experimental-rerun is refused: it reads a pickle, which can run any code; "
            "use from=DIR to take the configuration of the job in that directory"
        )
    primary, given.overrides = choose_primary(given.overrides)
    if given.config_name is not None:
        if primary != "config":
            raise ConfigError("--config-name and from= exclude each other")
        primary = given.config_name
    _leave_signals_to_the_job()
    logging.raiseExceptions = False  # a log that can't be written has nobody to tell
    try:
        with Application(given, primary) as application:
            if application.only_shows:
                application.show()
            else:
                _start(application, task, given)
    except Exception as error:
        # Hydra has an error for missing configuration that calls itself one of a file.
        of_a_file = isinstance(error, OSError) and not isinstance(error, HydraException)
        if task.began or full or of_a_file or isinstance(error, ConfigError):
            raise
        raise explain(error, given.overrides) from error
    finally:
        task.end()


def _start(application: Application, task: Task, given: Namespace) -> None:
    """Run the job or the sweep. If it is refused, its directory is left as it was."""
    config = application.compose()
    multirun = config.hydra.mode is RunMode.MULTIRUN
    if not multirun:
        typed = OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])
        to_config(typed, own=True)  # before there is a directory
    key = _PLACES[multirun]
    HydraConfig.instance().set_config(config)  # which the directory's name may refer to
    directory = OutputDirectory(Path(str(OmegaConf.select(config, key))))
    task.again = _command_again(key, directory.path)
    try:
        application.run(config, task)
    except BaseException as error:
        refused = isinstance(error, ConfigError) or (
            isinstance(error, SystemExit) and error.code == 2
        )
        if refused or not task.began:
            directory.restore()
        raise


def _command_again(key: str, directory: Path) -> str:
    """Return the command that resumes the work in its directory.

    Args:
        key: of the directory.
        directory: shown relative to the current directory if it lies below it.
    """
    path = directory.absolute()
    place = str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    if not re.fullmatch(r"[\w./+-]+", place):  # Hydra would read something into it
        place = "'" + place.replace("'", r"\'") + "'"
    program = Path(sys.argv[0])
    words = ["python", "-m", "fnnq_torchrl.train"] if program.suffix == ".py" else [program.name]
    left_out = (*_PLACES, "resume")  # resume=never would start over
    words += [word for word in sys.argv[1:] if key_of(word.removeprefix("--")) not in left_out]
    return shlex.join([*words, f"{key}={place}"])


@contextmanager
def errors_in_one_line(task: Task) -> Iterator[None]:
    """A block in which an error that isn't a bug ends the command with a line and a status.

    Args:
        task: has the command that resumes after an interruption.
    """
    try:
        yield
    except ConfigError as error:
        _leave(2, str(error))
    except JobFailed as error:
        _leave(1, str(error))
    except Interrupted as error:
        _leave(error.status, f"{error}; to go on: {task.again}")
    except OSError as error:
        if error.filename is not None:
            _leave(1, f"{error.filename}: {error.strerror}")
        if error.errno not in _OF_DISKS:  # not the fault of a file
            raise
        _leave(1, str(error.strerror))  # of Hydra's own files or the terminal: it has no name
    except KeyboardInterrupt:
        _leave(130, f"interrupted; to go on: {task.again}" if task.began else "interrupted")


def _leave(status: int, message: str) -> NoReturn:
    with suppress(OSError):  # the log may be on the disk that is full
        sys.stderr.write(" ".join(message.split()) + "\n")
        sys.stderr.flush()
    sys.exit(status)


def _leave_signals_to_the_job() -> None:
    """Ignore the signals that ask for a save: outside a training there is nothing to save."""
    for name in SAVING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.SIG_IGN)
