"""The form of every command: Hydra's command line in, a valid `Config` out, errors in one line."""

import errno
import functools
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, NoReturn

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, env_override
from hydra.errors import HydraException
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.launch.arguments import OneLineParser
from fnnq_torchrl.launch.batches import RunBatches
from fnnq_torchrl.launch.composition import VERSION_BASE, explain
from fnnq_torchrl.launch.from_job import choose_primary
from fnnq_torchrl.launch.launcher import Multirun
from fnnq_torchrl.training.jobs import JobFailed
from fnnq_torchrl.training.resume.interruptions import SAVING, Interrupted
from hydra_plugins.fnnq_torchrl import BatchLauncher, BatchSweeper

FULL_ERROR = "HYDRA_FULL_ERROR"  # the variable that makes Hydra raise its errors, not print them

_OF_DISKS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EPIPE}

RunJob = Callable[[Config, Path], float | None]
"""Does a job, and returns its value for a sweeper."""


class Task:
    """The two things a command does with what Hydra composes: one job, or a multirun's jobs.

    Args:
        job: does one job.
        run_batches: does the jobs of a multirun.

    Attributes:
        began: Hydra has composed, and has handed over. Whatever fails now is no mistake in what the
            user typed.
    """

    def __init__(self, job: RunJob, run_batches: RunBatches) -> None:
        functools.update_wrapper(self, job)  # Hydra names the log after the module of the job
        self._job, self._run_batches = job, run_batches
        self._multirun: Multirun | None = None
        self.began = False

    def __call__(self, node: DictConfig) -> float | None:
        """Do one job, and return its value for a sweeper."""
        with errors_in_one_line():  # where Hydra would add a line of its own
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
        """Finish the multirun, if it is one: the sweeper, which doesn't tell, launches no more."""
        if self._multirun is not None:
            self._multirun.end()


def command(job: RunJob, run_batches: RunBatches) -> Callable[[], None]:
    """Make a job a command.

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
    for plugin in (BatchLauncher, BatchSweeper):  # Hydra finds them itself, if not everywhere
        Plugins.instance().register(plugin)

    @functools.wraps(job)
    def main() -> None:
        full = os.environ.get(FULL_ERROR) == "1"
        with nullcontext() if full else errors_in_one_line():
            _run(Task(job, run_batches), full)

    return main


def _run(task: Task, full: bool) -> None:
    """Run Hydra on what is typed.

    Args:
        task: for Hydra to call.
        full: Hydra's errors are raised as they are.
    """
    primary, arguments = choose_primary(sys.argv[1:])
    # Hydra's parser takes no flag between overrides.
    arguments.sort(key=lambda argument: argument in ("-m", "--multirun"))
    given = OneLineParser(parents=[get_args_parser()], add_help=False).parse_args(arguments)
    if given.experimental_rerun is not None:
        raise ConfigError(
            "--experimental-rerun: reads a pickle, which can run any code; "
            "from=DIR takes the configuration of the job in that directory"
        )
    if given.config_name is not None and primary != "config":
        raise ConfigError("--config-name and from= exclude each other")
    _leave_signals_to_the_job()
    logging.raiseExceptions = False  # a log that can't be written has nobody to tell
    application = hydra.main(
        version_base=VERSION_BASE, config_path=str(config_directory()), config_name=primary
    )(task)
    sys.argv = [sys.argv[0], *arguments]  # for Hydra to read
    try:
        with env_override({FULL_ERROR: "1"}):
            application()
    except Exception as error:
        # Hydra has an error for missing configuration that calls itself one of a file.
        of_a_file = isinstance(error, OSError) and not isinstance(error, HydraException)
        if task.began or full or of_a_file or isinstance(error, ConfigError):
            raise
        raise explain(error, given.overrides, multirun=given.multirun) from error
    finally:
        task.end()


@contextmanager
def errors_in_one_line() -> Iterator[None]:
    """Within the block, an error that isn't a bug ends the command with a line and a status."""
    try:
        yield
    except ConfigError as error:
        _leave(2, str(error))
    except JobFailed as error:
        _leave(1, str(error))
    except Interrupted as error:
        _leave(error.status, str(error))
    except OSError as error:
        if error.filename is not None:
            _leave(1, f"{error.filename}: {error.strerror}")
        if error.errno not in _OF_DISKS:  # no file's fault
            raise
        _leave(1, str(error.strerror))  # Hydra's own files, or the terminal, which name none
    except KeyboardInterrupt:
        _leave(130, "interrupted")


def _leave(status: int, message: str) -> NoReturn:
    with suppress(OSError):  # the log may be on the disk that is full
        sys.stderr.write(" ".join(message.split()) + "\n")
        sys.stderr.flush()
    sys.exit(status)


def _leave_signals_to_the_job() -> None:
    """Ignore what asks for a save where there is nothing to save yet, or any more."""
    for name in SAVING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.SIG_IGN)


def fresh_directory(path: str) -> str:
    """Make the directory ``path`` or, where there is one already, ``path_2``, ``path_3``, ….

    Two jobs that start within a second never share one: the system makes it for the first only.
    """
    name, number = path, 1
    while True:
        with suppress(FileExistsError):
            Path(name).mkdir(parents=True)
            return name
        number += 1
        name = f"{path}_{number}"


def _directory(path: str) -> str:
    """Return a job's directory for conf/config.yaml. What is only shown makes none."""
    given, _ = get_args_parser().parse_known_args(sys.argv[1:])
    return path if given.cfg else fresh_directory(path)


# With the cache, all that one application asks for the path is one directory.
OmegaConf.register_new_resolver("fresh_directory", _directory, use_cache=True, replace=True)
