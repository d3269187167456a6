"""The chosen loggers side by side; whatever one does, training and result files go on."""

import atexit
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from operator import methodcaller
from typing import Any, ClassVar

from fnnq_torchrl.config.loggers import LoggerConfig
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.terminal import announce

from .base import JobResults, Logger, SweepResults

_FAILED = "going on without {}, which has failed"


class Loggers:
    """The loggers of some jobs.

    A logger that fails, as it begins or later, is told of in one line, and left out from then on.

    Args:
        config: which there are.

    Raises:
        ConfigError: a logger's library isn't installed, or it can't log as it is asked to.
    """

    left_out: ClassVar[set[str]] = set()
    """The names of those that have failed in this process."""

    _made: ClassVar[dict[str, "Loggers"]] = {}

    def __init__(self, config: LoggerConfig) -> None:
        self._loggers: dict[str, Logger] = {}
        for name, settings in vars(config).items():
            if settings is not None:
                self._guard(name, partial(self._add, name, settings))

    @classmethod
    def of(cls, config: LoggerConfig) -> "Loggers":
        """The same for the same configuration, however often a process asks for them."""
        key = repr(config)
        if key not in cls._made:
            cls._made[key] = cls(config)
        return cls._made[key]

    @classmethod
    def close_all(cls) -> None:
        """At the end of the process; see `Logger.close`."""
        for loggers in cls._made.values():
            loggers._each(methodcaller("close"), "{} has failed at its end")
        cls._made.clear()

    @classmethod
    def forget(cls) -> None:
        """Begin as in a new process."""
        cls._made.clear()
        cls.left_out.clear()

    def foresee(self, jobs: Sequence[Job]) -> None:
        """See `Logger`."""
        self._each(methodcaller("foresee", jobs))

    def log_jobs(self, jobs: Iterable[Job]) -> None:
        """Log finished jobs, one after the other."""
        for results in map(JobResults, jobs):
            self._log(methodcaller("log_job", results))

    def log_sweep(self, sweep: SweepResults) -> None:
        """See `Logger`."""
        self._log(methodcaller("log_sweep", sweep))

    def _log(self, log: Callable[[Logger], None]) -> None:
        self._each(log)
        # Anew, so as to come before what the loggers' libraries have registered by now.
        atexit.unregister(Loggers.close_all)
        atexit.register(Loggers.close_all)

    def _add(self, name: str, settings: Any) -> None:
        """Only now is its module imported: their libraries take seconds."""
        try:
            module = import_module(f".{name}", __package__)
        except ImportError as error:
            install = f"pip install 'fnnq_torchrl[{name}]'"
            raise ConfigError(
                f"logger={name}: needs a library that isn't there; {install}"
            ) from error
        self._loggers[name] = getattr(module, f"{name.capitalize()}Logger")(settings)

    def _each(self, log: Callable[[Logger], None], failed: str = _FAILED) -> None:
        for name, logger in self._loggers.items():
            self._guard(name, partial(log, logger), failed)

    def _guard(self, name: str, use: Callable[[], None], failed: str = _FAILED) -> None:
        """Use a logger, unless it has failed; if it does so now, say so."""
        if name in self.left_out:
            return
        try:
            use()
        except ConfigError:
            raise
        except Exception as error:  # whatever it is: no result depends on it
            self.left_out.add(name)
            reason = " ".join(str(error).split()) or type(error).__name__
            announce(f"{failed.format(name)}: {reason}")
