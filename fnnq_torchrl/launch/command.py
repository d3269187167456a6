"""What every command has in common: Hydra's command line in, a valid `Config` out, clean errors."""

import errno
import functools
import logging
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import NoReturn

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.core.utils import env_override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import Config, ConfigError, to_config
from fnnq_torchrl.launch.composition import VERSION_BASE, SeveralValues, explain, is_of_hydra
from fnnq_torchrl.launch.flags import as_typed, check_flags, only_shows
from fnnq_torchrl.training.jobs import Job, JobFailed, Result, RunBatches
from fnnq_torchrl.training.resume.interruptions import SAVING, Interrupted
from hydra_plugins.fnnq_torchrl import BatchLauncher, BatchSweeper

_OF_DISKS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.EPIPE}

FULL_ERROR = "HYDRA_FULL_ERROR"  # the variable that makes Hydra raise its errors, not print them


def command(
    job: Callable[[Config, Path], float | None], run_batches: RunBatches | None = None
) -> Callable[[], None]:
    """Makes a job a command.

    A mistake in the configuration, or any `ConfigError` of the job, is one line on stderr and exit
    status 2; a job that failed, or a file that can't be read or written, is one line and status 1;
    Ctrl-C is status 130, another signal 128 and its number; every other exception keeps its
    traceback. A user who sets HYDRA_FULL_ERROR=1 gets Hydra's own errors with theirs.

    Args:
        job: takes the configuration and the directory, which exists, for what it writes. What it
            returns is the job's value for a sweeper.
        run_batches: does the same for batches of jobs at once; yields the results of each batch
            (see :func:`fnnq_torchrl.training.job.run_batches`). If not given, job follows job.

    Returns:
        A function without arguments that reads ``sys.argv``: one job, or those of a sweep with
        ``-m``.
    """

    @functools.wraps(job)  # Hydra names the job's log after the file that this leads to
    def task(node: DictConfig) -> float | None:
        try:
            return job(to_config(node), Path(HydraConfig.get().runtime.output_dir))
        except ConfigError as error:  # Hydra would go on with the sweep and add a line of its own
            _leave(2, str(error))
        except OSError as error:
            _leave_over_a_file(error)

    task.run_batches = run_batches or _one_by_one(job)  # type: ignore[attr-defined]
    # What the launcher has to do when the sweeper, which it doesn't know, launches no more.
    at_end: list[Callable[[], None]] = []
    task.at_end = at_end  # type: ignore[attr-defined]
    for plugin in (BatchLauncher, BatchSweeper):  # Hydra finds them itself, if not everywhere
        Plugins.instance().register(plugin)
    hydra_application = hydra.main(
        version_base=VERSION_BASE, config_path=str(config_directory()), config_name="config"
    )(task)

    def application() -> None:
        at_end.clear()
        try:
            hydra_application()
        finally:
            for end in at_end:
                end()

    @functools.wraps(job)
    def main() -> None:
        try:
            check_flags(sys.argv[0], sys.argv[1:])
        except ConfigError as error:
            _leave(2, str(error))
        _leave_signals_to_the_job()
        logging.raiseExceptions = False  # a log that can't be written has nobody to tell
        if os.environ.get(FULL_ERROR) == "1":
            return application()
        try:
            with env_override({FULL_ERROR: "1"}):
                application()
        except ConfigError as error:
            _leave(2, str(error))
        except (HydraException, OmegaConfBaseException) as error:
            told = explain(error, sys.argv[1:])
            several = isinstance(told, SeveralValues)
            _leave(2, f"{told}; type {as_typed(*sys.argv, '-m')}" if several else str(told))
        except JobFailed as error:
            _leave(1, str(error))
        except Interrupted as error:
            _leave(error.status, str(error))
        except OSError as error:
            _leave_over_a_file(error)
        except KeyboardInterrupt:
            _leave(130, "interrupted")
        except Exception as error:
            if not is_of_hydra(error):
                raise
            _leave(2, str(explain(error, sys.argv[1:])))

    return main


def _one_by_one(job: Callable[[Config, Path], float | None]) -> RunBatches:
    def run(each: Job) -> Result:
        try:
            return job(each.config, each.directory)
        except (JobFailed, OSError) as error:
            return error

    def run_batches(
        batches: Sequence[Sequence[Job]], *, pictures: bool
    ) -> Iterator[Sequence[Result]]:
        for batch in batches:
            yield [run(each) for each in batch]

    return run_batches


def _leave(status: int, message: str) -> NoReturn:
    with suppress(OSError):  # the log may be on the disk that is full
        sys.stderr.write(" ".join(message.split()) + "\n")
        sys.stderr.flush()
    sys.exit(status)


def _leave_over_a_file(error: OSError) -> NoReturn:
    if error.filename is not None:
        _leave(1, f"{error.filename}: {error.strerror}")
    if error.errno not in _OF_DISKS:  # no file's fault
        raise error
    _leave(1, str(error.strerror))  # Hydra's own files, or the terminal, which name none


def _leave_signals_to_the_job() -> None:
    """What asks for a save must not end a command that has nothing to save yet, or any more."""
    for name in SAVING:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.SIG_IGN)


def fresh_directory(path: str) -> str:
    """Makes the directory `path` or, where there is one already, ``path_2``, ``path_3``, ….

    Two jobs that start within a second never share one: the system makes it for the first only.
    """
    names = chain([path], (f"{path}_{number}" for number in count(2)))
    while True:
        name = next(names)
        try:
            Path(name).mkdir(parents=True)
        except FileExistsError:
            continue
        return name


def _directory(path: str) -> str:
    """For conf/config.yaml: what is only to be shown makes no directory."""
    return path if only_shows() else fresh_directory(path)


# With the cache, all that one application asks for the path is one directory.
OmegaConf.register_new_resolver("fresh_directory", _directory, use_cache=True, replace=True)
