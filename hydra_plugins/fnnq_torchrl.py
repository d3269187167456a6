"""The launcher and the sweeper of fnnq_torchrl, where Hydra looks for plugins.

Every Hydra application on a machine imports this file if it is installed there, so it is light.
"""

from collections.abc import Sequence
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.utils import JobReturn
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class BatchLauncher(Launcher):
    """Runs the jobs of a multirun in batches: `fnnq_torchrl.launcher.Multirun`.

    Args:
        **settings: those of ``conf/hydra/launcher/batch.yaml``.
    """

    def __init__(self, **settings: Any) -> None:
        self._settings = settings

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        from fnnq_torchrl.launcher import Multirun

        self._multirun = Multirun(self._settings, hydra_context, task_function, config)

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        return self._multirun.launch(job_overrides, initial_job_idx)


class BatchSweeper(BasicSweeper):
    """Hydra's own sweeper, without composing all jobs once more before the launcher does."""

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        if not isinstance(self.launcher, BatchLauncher):
            super().validate_batch_is_legal(batch)
