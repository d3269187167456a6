"""What every command has in common: Hydra's command line in, a valid `Config` out, clean errors."""

import functools
import os
import sys
from collections.abc import Callable
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

from fnnq_torchrl.compose import VERSION_BASE, config_directory, explain
from fnnq_torchrl.config import Config, ConfigError, to_config
from hydra_plugins.fnnq_torchrl_cases import CaseSweeper

# Hydra finds it by itself only where hydra_plugins is a folder of the path.
Plugins.instance().register(CaseSweeper)

FULL_ERROR = "HYDRA_FULL_ERROR"  # the variable that makes Hydra raise its errors, not print them


def command(job: Callable[[Config, Path], None]) -> Callable[[], None]:
    """Makes a job a command.

    A mistake in the configuration, or any `ConfigError` of the job, is one line on stderr and exit
    status 2; a file that can't be read or written is one line and status 1; Ctrl-C is status 130;
    every other exception keeps its traceback. A user who sets HYDRA_FULL_ERROR=1 gets Hydra's own
    errors with theirs.

    Args:
        job: takes the configuration and the directory, which exists, for what it writes.

    Returns:
        A function without arguments that reads ``sys.argv``: one job, or one after the other
        with ``-m``.
    """

    @functools.wraps(job)  # Hydra names the job's log after the file that this leads to
    def task(node: DictConfig) -> None:
        try:
            job(to_config(node), Path(HydraConfig.get().runtime.output_dir))
        except ConfigError as error:  # Hydra would go on with the sweep and add a line of its own
            _leave(2, str(error))
        except OSError as error:
            _leave_over_a_file(error)

    application = hydra.main(
        version_base=VERSION_BASE, config_path=str(config_directory()), config_name="config"
    )(task)

    @functools.wraps(job)
    def main() -> None:
        if os.environ.get(FULL_ERROR) == "1":
            return application()
        try:
            with env_override({FULL_ERROR: "1"}):
                application()
        except (HydraException, OmegaConfBaseException) as error:
            _leave(2, str(explain(error, sys.argv[1:])))
        except OSError as error:
            _leave_over_a_file(error)
        except KeyboardInterrupt:
            _leave(130, "interrupted")

    return main


def _leave(status: int, message: str) -> NoReturn:
    sys.stderr.write(" ".join(message.split()) + "\n")
    sys.exit(status)


def _leave_over_a_file(error: OSError) -> NoReturn:
    if error.filename is None:  # no file's fault
        raise error
    _leave(1, f"{error.filename}: {error.strerror}")


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


# For conf/config.yaml. With the cache, all that one application asks for the path is one directory.
OmegaConf.register_new_resolver("fresh_directory", fresh_directory, use_cache=True, replace=True)
