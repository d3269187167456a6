"""The launcher and the sweeper of fnnq_torchrl, where Hydra looks for plugins.

Every Hydra application on a machine imports this file if it is installed there, so it is light.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.utils import JobReturn
from hydra.errors import HydraException
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class BatchLauncher(Launcher):
    """Runs the jobs of a multirun in batches: `fnnq_torchrl.launch.launcher.Multirun`.

    Args:
        **settings: those of ``conf/hydra/launcher/batch.yaml``.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        from fnnq_torchrl.launch.launcher import Multirun

        self._multirun = Multirun(self._settings, hydra_context, task_function, config)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        return self._multirun.launch(job_overrides, initial_job_idx)


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
        super().__init__(max_batch_size, params or {})  # type: ignore[arg-type]  # see setup
        self._cases = cases

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        super().setup(hydra_context=hydra_context, task_function=task_function, config=config)
        most = self.max_batch_size
        for key, value, fine, words in (
            ("cases", self._cases, _is_grids(self._cases), "a list of grids {key: values}"),
            ("params", self.params, isinstance(self.params, Mapping), "a grid {key: values}"),
            ("max_batch_size", most, _is_whole_or_null(most), "a whole number >= 1, or null"),
        ):
            if not fine:
                raise HydraException(f"hydra.sweeper.{key}={value}: must be {words}")

    def split_arguments(  # type: ignore[override]  # the base has it static, and calls it on self
        self, overrides: list[Override], max_batch_size: int | None
    ) -> list[list[list[str]]]:
        """The batches of jobs, each a list of overrides; no job comes twice."""
        for override in overrides:
            if override.is_discrete_sweep() and not any(True for _ in override.sweep_iterator()):
                raise HydraException(f"{override.input_line}: there is no value in it")
        parser = OverridesParser.create()
        jobs: dict[tuple[str, ...], None] = {}
        for case in self._cases:
            grid = parser.parse_overrides([f"{key}={values}" for key, values in case.items()])
            (batch,) = BasicSweeper.split_arguments([*grid, *overrides], None)
            jobs |= dict.fromkeys(map(tuple, batch))
        chunks = self.split_overrides_to_chunks([list(job) for job in jobs], max_batch_size)
        return list(chunks)

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        if not isinstance(self.launcher, BatchLauncher):
            super().validate_batch_is_legal(batch)


def _is_grids(cases: object) -> bool:
    return isinstance(cases, Sequence) and all(isinstance(case, Mapping) for case in cases)


def _is_whole_or_null(number: object) -> bool:
    return number is None or (type(number) is int and number >= 1)
