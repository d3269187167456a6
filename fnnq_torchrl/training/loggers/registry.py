"""The registry of loggers, and the loggers of a command. Their failures never stop a training."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.terminal import announce

from .base import JobResults, Logger, SweepResults


def _wandb(settings: Any) -> Logger:
    from .wandb import WandbLogger

    return WandbLogger(settings)


def _tensorboard(settings: Any) -> Logger:
    from .tensorboard import TensorboardLogger

    return TensorboardLogger(settings)


def _mlflow(settings: Any) -> Logger:
    from .mlflow import MlflowLogger

    return MlflowLogger(settings)


LOGGERS: dict[str, Callable[[Any], Logger]] = {
    "wandb": _wandb,
    "tensorboard": _tensorboard,
    "mlflow": _mlflow,
}
"""The functions that make a logger from its settings, by the logger's name.

A function imports its library only when it is called: libraries are optional, and slow to load.
"""


class Loggers:
    """The loggers of one command; a logger is made for the first job that chooses it.

        with contextlib.closing(Loggers()) as loggers:
            loggers.prepare([job])
            ...
            loggers.log_job(job)

    When a logger fails, one line is printed, and that logger is not used again. The training and
    the other loggers go on.

    Attributes:
        left_out: the names of the loggers that have failed.

    Raises:
        ConfigError: by a method that makes a logger, if the logger's library isn't installed or its
            settings can't be followed. Call `prepare` before training to get this error early.
    """

    def __init__(self) -> None:
        self.left_out: set[str] = set()
        self._made: dict[tuple[str, str], Logger] = {}

    def prepare(self, jobs: Iterable[Job]) -> None:
        """Make the loggers of these jobs, and call each logger's ``prepare`` with its jobs."""
        self._each(jobs, lambda logger, its_jobs: logger.prepare(its_jobs))

    def log_job(self, job: Job) -> None:
        """Log a finished job."""
        results = JobResults(job)
        self._each([job], lambda logger, _: logger.log_job(results))

    def log_sweep(self, sweep: SweepResults) -> None:
        """Log a sweep as a whole, with each logger that one of its jobs chooses."""
        self._each(sweep.jobs, lambda logger, _: logger.log_sweep(sweep))

    def close(self) -> None:
        """Close the loggers at the end of the command, which waits for their background work."""
        for (name, _), logger in self._made.items():
            with self._guarded(name):
                logger.close()

    def _each(self, jobs: Iterable[Job], use: Callable[[Logger, list[Job]], None]) -> None:
        """Call ``use`` once for each chosen logger, with the jobs that choose that logger."""
        choices: dict[tuple[str, str], tuple[Any, list[Job]]] = {}
        for job in jobs:
            for name in LOGGERS:
                if (settings := getattr(job.config.logger, name)) is not None:
                    choices.setdefault((name, repr(settings)), (settings, []))[1].append(job)
        for key, (settings, its_jobs) in choices.items():
            name, _ = key
            if name not in self.left_out:
                with self._guarded(name):
                    if key not in self._made:
                        self._made[key] = _make(name, settings)
                    use(self._made[key], its_jobs)

    @contextmanager
    def _guarded(self, name: str) -> Iterator[None]:
        """Report a failure of the block, which uses a logger, and never use the logger again."""
        try:
            yield
        except ConfigError:
            raise
        except Exception as error:  # of any kind, since no result depends on it
            if name not in self.left_out:
                self.left_out.add(name)
                reason = " ".join(str(error).split()) or type(error).__name__
                announce(f"going on without {name}, which has failed: {reason}")


def _make(name: str, settings: Any) -> Logger:
    try:
        return LOGGERS[name](settings)
    except ImportError as error:
        raise ConfigError(
            f"logger={name}: needs a library that isn't installed; {installing(name)}"
        ) from error
