"""The registry of loggers, and the loggers of a command, which never stop a training."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

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
"""Functions that make a logger from its settings, by its name.

Each imports its library only when it is called: libraries are optional, and slow to load.
"""


class Loggers:
    """The loggers of one command, each made for the first job that chooses it.

        with contextlib.closing(Loggers()) as loggers:
            loggers.prepare([job])
            ...
            loggers.log_job(job)

    When a logger fails, the user is told in one line, and it is left out from then on. Everything
    else goes on.

    Attributes:
        left_out: the names of the loggers that have failed.

    Raises:
        ConfigError: by a method that makes a logger, as `prepare` does before anything is trained:
            its library isn't installed, or its settings can't be followed.
    """

    def __init__(self) -> None:
        self.left_out: set[str] = set()
        self._made: dict[tuple[str, str], Logger] = {}

    def prepare(self, jobs: Iterable[Job]) -> None:
        """Make the loggers of these jobs, and tell the user what to expect of them."""
        self._each(jobs, lambda logger, its_jobs: logger.prepare(its_jobs))

    def log_job(self, job: Job) -> None:
        """Log a finished job."""
        results = JobResults(job)
        self._each([job], lambda logger, _: logger.log_job(results))

    def log_sweep(self, sweep: SweepResults) -> None:
        """Log a sweep with all loggers that its jobs choose."""
        self._each(sweep.jobs, lambda logger, _: logger.log_sweep(sweep))

    def close(self) -> None:
        """Wait for work in the background, at the end of the command."""
        for (name, _), logger in self._made.items():
            with self._guarded(name):
                logger.close()

    def _each(self, jobs: Iterable[Job], use: Callable[[Logger, list[Job]], None]) -> None:
        """Call ``use`` with each logger that the jobs choose, and the jobs that choose it."""
        choices: dict[tuple[str, str], tuple[Any, list[Job]]] = {}
        for job in jobs:
            for name, settings in vars(job.config.logger).items():
                if settings is not None:
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
        """A block that uses a logger. If it fails, the user is told, and it isn't used again."""
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
        install = f"pip install 'fnnq_torchrl[{name}]'"
        raise ConfigError(
            f"logger={name}: needs a library that isn't installed; {install}"
        ) from error
