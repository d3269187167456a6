"""The launcher and the sweeper of fnnq_torchrl, where Hydra looks for plugins.

Every Hydra application on a machine imports this file if it is installed there, so it is light.
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.utils import JobReturn
from hydra.errors import HydraException
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class BatchLauncher(Launcher):
    """Hands the jobs of a multirun to the task of the command, which runs them in batches.

    Args:
        **settings: those of ``conf/hydra/launcher/batch.yaml``.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Prepare the task, a ``fnnq_torchrl.launch.command.Task``."""
        self._task = cast(Any, task_function)
        self._task.set_up(self._settings, hydra_context, config)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run some jobs, and return what became of them in their order."""
        returns: list[JobReturn] = self._task.launch(job_overrides, initial_job_idx)
        return returns


class BatchSweeper(BasicSweeper):
    """Hydra's own sweeper, over several grids, one after the other.

    It leaves it to the launcher to compose the jobs, which is faster.

    Args:
        cases: each a grid, keys with their values as on the command line; ``{}`` is a single job.
        params: swept within every case, as are sweeps on the command line, which come last: they
            replace what a case says of their keys.
        max_batch_size: jobs that are launched together; all, if not given.
    """

    def __init__(
        self,
        cases: Sequence[Mapping[str, Any]],
        params: Mapping[str, str] | None = None,
        max_batch_size: int | None = None,
    ) -> None:
        super().__init__(max_batch_size, dict(params or {}))
        self._cases = cases

    def split_arguments(  # type: ignore[override]  # the base has it static, and calls it on self
        self, overrides: list[Override], max_batch_size: int | None
    ) -> list[list[list[str]]]:
        """Return the batches of jobs, each job a list of overrides; no job comes twice.

        Raises:
            HydraException: the cases aren't grids, or one of the sweeps is empty.
        """
        cases = self._cases
        if not isinstance(cases, Sequence) or not all(isinstance(case, Mapping) for case in cases):
            raise HydraException(
                f"hydra.sweeper.cases={cases}: must be a list of grids {{key: values}}"
            )
        for override in overrides:
            if override.is_discrete_sweep() and not any(True for _ in override.sweep_iterator()):
                raise HydraException(f"{override.input_line}: there is no value in it")
        parser = OverridesParser.create()
        jobs: dict[tuple[str, ...], None] = {}
        for case in cases:
            grid = parser.parse_overrides([f"{key}={values}" for key, values in case.items()])
            (batch,) = BasicSweeper.split_arguments([*grid, *overrides], None)
            jobs |= dict.fromkeys(map(tuple, batch))
        chunks = self.split_overrides_to_chunks([list(job) for job in jobs], max_batch_size)
        return list(chunks)

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        """Compose the jobs to check them, unless the launcher does."""
        if not isinstance(self.launcher, BatchLauncher):
            super().validate_batch_is_legal(batch)
