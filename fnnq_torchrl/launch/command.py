"""Makes a command of a function that does a job: Hydra's command line, errors in one line."""

import errno
import logging
import os
import re
import shlex
import signal
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn

from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn
from hydra.errors import HydraException
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig, OmegaConf

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.launch.application import Application
from fnnq_torchrl.launch.batches import RunBatches
from fnnq_torchrl.launch.composition import explain, key_of, offer_own_step_sizes
from fnnq_torchrl.launch.directories import OutputDirectory
from fnnq_torchrl.launch.flags import hydra_arguments
from fnnq_torchrl.launch.from_job import choose_primary
from fnnq_torchrl.launch.help import help_page
from fnnq_torchrl.launch.interrupted import leave_interrupted
from fnnq_torchrl.launch.launcher import Multirun
from fnnq_torchrl.launch.streams import lasting_streams, one_line
from fnnq_torchrl.training.jobs import JobFailed
from fnnq_torchrl.training.resume.interruptions import SAVING, Interrupted
from hydra_plugins.fnnq_torchrl import BatchLauncher, BatchSweeper, OptunaSweeper

_FULL_ERROR = "HYDRA_FULL_ERROR"
"""The environment variable that asks for Hydra's errors with their tracebacks."""

_OF_DISKS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}

_PLACES = ("hydra.run.dir", "hydra.sweep.dir")
"""The keys that set the output directory: of a single job, and of a sweep."""

RunJob = Callable[[Config, Path], float | None]
"""A function that does one job in a directory, and returns the job's value for a sweeper."""


class Task:
    """The task that Hydra calls to do a command's work: one job, or the jobs of a multirun.

    Args:
        job: the function that does a single job.
        run_batches: the function that does the jobs of a multirun.

    Attributes:
        began: whether the work has begun. A later error is not a mistake in the command line.
        again: the command that resumes the work after an interruption; empty until it is known.
    """

    def __init__(self, job: RunJob, run_batches: RunBatches) -> None:
        self._job, self._run_batches = job, run_batches
        self._multirun: Multirun | None = None
        self.began, self.again = False, ""

    def __call__(self, node: DictConfig) -> float | None:
        """Do one job, and return its value for a sweeper."""
        with errors_in_one_line(self):  # here, since Hydra's run_job adds a line to errors
            config = to_config(node, own=True)
            directory = Path(HydraConfig.get().runtime.output_dir)
            self.began = True
            return self._job(config, directory)

    def set_up(
        self, settings: Mapping[str, Any], context: HydraContext, config: DictConfig
    ) -> None:
        """Prepare a multirun; the arguments are those of `Multirun`."""
        self._multirun = Multirun(settings, context, config, self._run_batches)

    def launch(self, job_overrides: Sequence[Sequence[str]], first: int) -> list[JobReturn]:
        """Run the next jobs of the multirun: see `Multirun.launch`."""
        assert self._multirun is not None
        self.began = True
        return self._multirun.launch(job_overrides, first)

    def search(self, *arguments: Any) -> None:
        """Search for the best values: the arguments are those of `Search`.

        Raises:
            ConfigError: if Optuna isn't installed, or for the reasons that `Search` lists.
        """
        try:
            from fnnq_torchrl.launch.search import Search
        except ImportError as error:
            needs = f"needs a library that isn't installed; {installing('optuna')}"
            raise ConfigError(f"hydra/sweeper=optuna: {needs}") from error
        Search(*arguments).run()

    def end(self) -> None:
        """Finish the multirun, if there is one; called once, after the sweeper's last launch."""
        if self._multirun is not None:
            self._multirun.end()


def command(job: RunJob, run_batches: RunBatches) -> Callable[[], None]:
    """Return the command that does a job, or the jobs of a sweep.

    Each of these errors ends the command with one line on stderr and an exit status:

    * a mistake in the configuration, or another `ConfigError`: status 2;
    * a failed job, or a file that can't be read or written: status 1;
    * Ctrl-C: status 130; another signal that ends the work: 128 + its number.

    Any other exception keeps its traceback. With HYDRA_FULL_ERROR=1, Hydra's own errors do, too.

    Args:
        job: the function that does one job. It takes the configuration and the existing output
            directory, and returns the job's value for a sweeper.
        run_batches: the function that does batches of jobs
            (see :func:`fnnq_torchrl.training.job.run_batches`).

    Returns:
        A function without arguments that does the job or the sweep that ``sys.argv`` asks for.
    """
    # Hydra doesn't find them in every installation.
    for plugin in (BatchLauncher, BatchSweeper, OptunaSweeper):
        Plugins.instance().register(plugin)
    # Another plugin may have a schema of the name of our sweeper, which Hydra would apply to it.
    ConfigStore.instance().repo["hydra"].get("sweeper", {}).pop("optuna.yaml", None)

    def main() -> None:
        task, full = Task(job, run_batches), os.environ.get(_FULL_ERROR) == "1"
        with lasting_streams(), nullcontext() if full else errors_in_one_line(task):
            _run(task, full)

    return main


def _run(task: Task, full: bool) -> None:
    """Parse ``sys.argv`` and run the job or the sweep, or show what a flag asks for.

    Args:
        task: the task that Hydra calls.
        full: whether Hydra's errors are raised unchanged.
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
    offer_own_step_sizes(given.overrides)
    primary, given.overrides = choose_primary(given.overrides)
    if given.config_name is not None:
        if primary != "config":
            raise ConfigError("--config-name and from= exclude each other")
        primary = given.config_name
    _leave_signals_to_the_job()
    logging.raiseExceptions = False  # no traceback if a log can't be written
    try:
        with Application(given, primary) as application:
            if application.only_shows:
                application.show()
            else:
                _start(application, task, given)
    except Exception as error:
        # Hydra's MissingConfigException is an OSError, but not one of a file.
        of_a_file = isinstance(error, OSError) and not isinstance(error, HydraException)
        if task.began or full or of_a_file or isinstance(error, ConfigError):
            raise
        raise explain(error, given.overrides) from error
    finally:
        task.end()


def _start(application: Application, task: Task, given: Namespace) -> None:
    """Run the job or the sweep. If its configuration is refused, restore its directory."""
    config = application.compose()
    multirun = config.hydra.mode is RunMode.MULTIRUN
    if not multirun:
        typed = OmegaConf.masked_copy(config, [str(key) for key in config if key != "hydra"])
        to_config(typed, own=True)  # before a directory is made
    key = _PLACES[multirun]
    HydraConfig.instance().set_config(config)  # the directory's name may refer to it
    path = str(OmegaConf.select(config, key))
    if "${" in path:
        raise ConfigError(f"{key}={path}: must be a path without ${{, which Hydra would resolve")
    directory = OutputDirectory(Path(path))
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
    """Return the command line that resumes the interrupted work in its directory.

    Args:
        key: the key that sets the directory, one of `_PLACES`.
        directory: the directory; its path is relative if it is inside the current directory.
    """
    path = directory.absolute()
    place = str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
    if not re.fullmatch(r"[\w./+-]+", place):  # characters that Hydra interprets
        place = "'" + place.replace("'", r"\'") + "'"
    program = Path(sys.argv[0])
    words = ["python", "-m", "fnnq_torchrl.train"] if program.suffix == ".py" else [program.name]
    left_out = (*_PLACES, "resume")  # with resume=never, the work would start over
    words += [word for word in sys.argv[1:] if key_of(word.removeprefix("--")) not in left_out]
    return shlex.join([*words, f"{key}={place}"])


@contextmanager
def errors_in_one_line(task: Task) -> Iterator[None]:
    """End the command with one line and an exit status if the block raises an expected error.

    Args:
        task: the task; its ``again`` is the command that resumes interrupted work.
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
        if error.errno not in _OF_DISKS:  # not a problem of a disk or file
            raise
        _leave(1, str(error.strerror))  # Hydra's own file: no name is known
    except KeyboardInterrupt:
        leave_interrupted(task.again if task.began else "")


def _leave(status: int, message: str) -> NoReturn:
    sys.stderr.write(f"{one_line(message)}\n")
    sys.exit(status)


def _leave_signals_to_the_job() -> None:
    """Ignore the signals that ask for a save: their default action would end the process."""
    for name in SAVING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.SIG_IGN)
