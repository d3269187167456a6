"""The launcher and the sweepers of fnnq_torchrl, in the package where Hydra looks for plugins.

Every Hydra application in the same Python environment imports this module, so it must load fast.
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn
from hydra.errors import HydraException
from hydra.plugins.launcher import Launcher
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class BatchLauncher(Launcher):
    """A launcher that passes the jobs of a multirun to the task, which trains them in batches.

    Args:
        **settings: the keys of ``conf/hydra/launcher/batch.yaml``.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Set up the task function, which must be a ``fnnq_torchrl.launch.command.Task``."""
        self._task = cast(Any, task_function)
        self._task.set_up(self._settings, hydra_context, config)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run the jobs and return their results in the same order."""
        returns: list[JobReturn] = self._task.launch(job_overrides, initial_job_idx)
        return returns


class BatchSweeper(BasicSweeper):
    """Hydra's basic sweeper over several grids, one after the other.

    Hydra composes every job before the launch; this sweeper leaves that to :class:`BatchLauncher`,
    which is faster.

    Args:
        cases: the grids: each maps keys to values as on the command line; ``{}`` is one job.
        params: further keys with values, swept within every case. Keys on the command line are
            also swept within every case, and replace the values of the case or of ``params``.
        max_batch_size: the number of jobs launched together; by default all jobs.
    """

    def __init__(
        self,
        cases: Sequence[Mapping[str, Any]],
        params: Mapping[str, str] | None = None,
        max_batch_size: int | None = None,
    ) -> None:
        super().__init__(max_batch_size, dict(params or {}))
        self._cases = cases

    def split_arguments(  # type: ignore[override]  # static in the base, but called on self
        self, overrides: list[Override], max_batch_size: int | None
    ) -> list[list[list[str]]]:
        """Return the batches of jobs without duplicates; a job is a list of overrides.

        Raises:
            HydraException: if ``cases`` isn't a list of mappings, or a sweep has no values.
        """
        cases = self._cases
        if not isinstance(cases, Sequence) or not all(isinstance(case, Mapping) for case in cases):
            raise HydraException(
                f"hydra.sweeper.cases={cases}: must be a list of grids {{key: values}}"
            )
        for override in overrides:
            if override.is_discrete_sweep() and not any(True for _ in override.sweep_iterator()):
                raise HydraException(
                    f"{override.input_line}: must have at least one value to sweep"
                )
        parser = OverridesParser.create()
        jobs: dict[tuple[str, ...], None] = {}
        for case in cases:
            grid = parser.parse_overrides([f"{key}={values}" for key, values in case.items()])
            (batch,) = BasicSweeper.split_arguments([*grid, *overrides], None)
            jobs |= dict.fromkeys(map(tuple, batch))
        chunks = self.split_overrides_to_chunks([list(job) for job in jobs], max_batch_size)
        return list(chunks)

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        """Compose the jobs to check them, unless :class:`BatchLauncher` composes them itself."""
        if not isinstance(self.launcher, BatchLauncher):
            super().validate_batch_is_legal(batch)


class OptunaSweeper(Sweeper):
    """A sweeper that passes the search for the best values to the task, which asks Optuna.

    Args:
        **settings: the keys of ``conf/hydra/sweeper/optuna.yaml``.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Set up the launcher; the task must be a ``fnnq_torchrl.launch.command.Task``."""
        self._task, self._context, self._config = cast(Any, task_function), hydra_context, config
        self._launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )

    def sweep(self, arguments: list[str]) -> None:
        """Search the values of these overrides."""
        self._task.search(self._settings, self._context, self._config, self._launcher, arguments)
