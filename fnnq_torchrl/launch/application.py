"""Runs Hydra on our ``conf/``: composes the typed configuration, then runs or shows it."""

from argparse import Namespace
from pathlib import Path
from types import TracebackType
from typing import Self

from hydra import version
from hydra._internal.callbacks import Callbacks
from hydra._internal.utils import create_config_search_path
from hydra.core.config_search_path import SearchPathQuery
from hydra.core.global_hydra import GlobalHydra
from hydra.core.plugins import Plugins
from hydra.core.utils import configure_log, run_job
from hydra.types import HydraContext, RunMode, TaskFunction
from omegaconf import DictConfig, OmegaConf

from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.composition import VERSION_BASE, check_plugins, refuse_several_values
from fnnq_torchrl.launch.directories import fresh_directory
from fnnq_torchrl.launch.loader import start_hydra


class Application:
    """Hydra with our search path and plugins, used as a ``with`` block.

    It takes the steps of ``hydra.main`` one by one. So the configuration is composed only once and
    checked before a directory is made, and a preset that sweeps needs no ``-m``.

    Args:
        given: the flags and overrides (:func:`fnnq_torchrl.launch.flags.hydra_arguments`).
        primary: the name of the primary configuration.

    Raises:
        ConfigError: if the directory of ``--config-dir`` doesn't exist.
    """

    def __init__(self, given: Namespace, primary: str) -> None:
        self._given, self._primary = given, primary
        self.only_shows = bool(
            given.cfg or given.info or given.shell_completion or given.hydra_help
        )
        version.setbase(VERSION_BASE)
        OmegaConf.register_new_resolver(
            "fresh_directory",
            str if self.only_shows else fresh_directory,
            use_cache=True,  # all keys of one application get the same directory
            replace=True,
        )
        main = Path(given.config_path or config_directory()).absolute()
        path = create_config_search_path(str(main))
        if given.config_dir is not None:
            further = Path(given.config_dir).absolute()
            if not further.is_dir():
                raise ConfigError(f"--config-dir {given.config_dir}: there is no such directory")
            path.prepend("command-line", f"file://{further}", SearchPathQuery(provider="schema"))
        self._hydra = start_hydra("train", path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        GlobalHydra.instance().clear()

    def show(self) -> None:
        """Show the output of ``--cfg`` or a similar flag; run nothing and make no directory."""
        given, primary = self._given, self._primary
        if given.cfg:
            self._hydra.show_cfg(primary, given.overrides, given.cfg, given.package, given.resolve)
        elif given.info:
            self._hydra.show_info(given.info, primary, given.overrides)
        elif given.shell_completion:
            self._hydra.shell_completion(primary, given.overrides)
        else:
            self._hydra.hydra_help(primary, given.parser, given)

    def compose(self) -> DictConfig:
        """Return the configuration, with ``hydra.mode`` set to ``RUN`` or ``MULTIRUN``.

        The mode is ``MULTIRUN`` if ``-m`` is typed or a preset sets it. If neither sets a mode, it
        is ``MULTIRUN`` exactly if the sweeper's settings list values to sweep.

        Raises:
            ConfigError: if a key has several values without ``-m``, or if our launcher or sweeper
                has no such key.
        """
        if not self._given.multirun:
            config = self._compose(RunMode.RUN)
            if not _sweeps(config.hydra):
                refuse_several_values(self._given.overrides)
                config.hydra.mode = RunMode.RUN
                return config
        return self._compose(RunMode.MULTIRUN, "hydra.mode=MULTIRUN")

    def _compose(self, mode: RunMode, *further: str) -> DictConfig:
        config = self._hydra.compose_config(
            self._primary,
            [*self._given.overrides, *further],
            mode,
            validate_sweep_overrides=mode is RunMode.MULTIRUN,
        )
        check_plugins(config.hydra)
        return config

    def run(self, config: DictConfig, task: TaskFunction) -> None:
        """Run the composed job, or all jobs of the composed multirun.

        Args:
            config: the configuration from :meth:`compose`.
            task: the function that does one job.
        """
        configure_log(config.hydra.hydra_logging, config.hydra.verbose)
        callbacks, name = Callbacks(config), self._primary
        context = HydraContext(self._hydra.config_loader, callbacks)
        if config.hydra.mode is RunMode.RUN:
            callbacks.on_run_start(config=config, config_name=name)
            done = run_job(
                hydra_context=context,
                task_function=task,
                config=config,
                job_dir_key="hydra.run.dir",
                job_subdir_key=None,
            )
            callbacks.on_run_end(config=config, config_name=name, job_return=done)
            _ = done.return_value  # raises the job's exception, if there was one
        else:
            callbacks.on_multirun_start(config=config, config_name=name)
            sweeper = Plugins.instance().instantiate_sweeper(
                hydra_context=context, task_function=task, config=config
            )
            sweeper.sweep(list(config.hydra.overrides.task))
            callbacks.on_multirun_end(config=config, config_name=name)


def _sweeps(hydra: DictConfig) -> bool:
    """Return whether a composed ``hydra`` node asks for a multirun."""
    if hydra.mode is not None:
        return bool(hydra.mode is RunMode.MULTIRUN)
    return bool(hydra.sweeper.get("params") or hydra.sweeper.get("cases", [{}]) != [{}])
