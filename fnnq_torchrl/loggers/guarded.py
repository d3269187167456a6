"""The chosen loggers side by side; whatever one does, training and result files go on."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import methodcaller
from typing import ClassVar

from fnnq_torchrl.batches import Job
from fnnq_torchrl.config import ConfigError
from fnnq_torchrl.logger_config import LoggerConfig
from fnnq_torchrl.report import announce

from .base import JobResults, Logger, SweepResults


class Loggers:
    """The loggers of some jobs.

    A logger that fails is told of in one line, and left out from then on.

    Args:
        config: which there are.

    Raises:
        ConfigError: a logger's library isn't installed, or it can't log as it is asked to.
    """

    left_out: ClassVar[set[str]] = set()
    """The names of those that have failed in this process."""

    def __init__(self, config: LoggerConfig) -> None:
        self._loggers = dict(_chosen(config))

    def foresee(self, jobs: Sequence[Job]) -> None:
        """See `Logger`."""
        self._each(methodcaller("foresee", jobs))

    def log_jobs(self, jobs: Iterable[Job]) -> None:
        """Log finished jobs, one after the other."""
        for results in map(JobResults, jobs):
            self._each(methodcaller("log_job", results))

    def log_sweep(self, sweep: SweepResults) -> None:
        """See `Logger`."""
        self._each(methodcaller("log_sweep", sweep))

    def _each(self, log: Callable[[Logger], None]) -> None:
        for name, logger in self._loggers.items():
            if name in self.left_out:
                continue
            try:
                log(logger)
            except Exception as error:  # whatever it is: the results are on the disk already
                self.left_out.add(name)
                reason = " ".join(str(error).split()) or type(error).__name__
                announce(f"going on without {name}, which has failed: {reason}")


def _chosen(config: LoggerConfig) -> Iterator[tuple[str, Logger]]:
    """The loggers by name. Each is imported only if it's chosen: their libraries take seconds."""
    name = ""
    try:
        if config.wandb is not None:
            name = "wandb"
            from .wandb import WandbLogger

            yield name, WandbLogger(config.wandb)
        if config.tensorboard is not None:
            name = "tensorboard"
            from .tensorboard import TensorboardLogger

            yield name, TensorboardLogger(config.tensorboard)
        if config.mlflow is not None:
            name = "mlflow"
            from .mlflow import MlflowLogger

            yield name, MlflowLogger(config.mlflow)
    except ImportError as error:
        install = f"pip install 'fnnq_torchrl[{name}]'"
        raise ConfigError(f"logger={name}: needs a library that isn't there; {install}") from error
