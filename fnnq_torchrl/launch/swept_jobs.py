"""The jobs of a Hydra multirun, composed once for all that differ only in per-run values.

Hydra takes a tenth of a second and more to compose a job, which is longer than many a job learns.
"""

import copy
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from hydra.core.config_loader import ConfigLoader
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from fnnq_torchrl.config.schema import ConfigError, flat, to_config
from fnnq_torchrl.files.atomic import atomic_write, clear_leftovers
from fnnq_torchrl.launch.composition import explain, is_of_hydra, key_of
from fnnq_torchrl.training.jobs import ASIDE, BATCHABLE, RESULTS, SNAPSHOTS, TRAINING, Job

_WHOLE, _DECIMAL = r"0|[1-9]\d*", r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_WHOLES = ("seed", "num_seeds")
_DECIMALS = [key for key in BATCHABLE if key not in _WHOLES]
_NUMBERS = [
    (re.compile(f"({'|'.join(_WHOLES)})=({_WHOLE})"), int),
    (re.compile(f"({'|'.join(_DECIMALS)})=({_DECIMAL})"), float),
]
"""The overrides that need no composing; whatever else may be said is Hydra's business."""

_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # in C where it is to be had


class SweptJob:
    """One job of a multirun.

    Attributes:
        number: of the job in its sweep.
        overrides: those that its sweeper gave it.
        task_overrides: of these, those that aren't about Hydra itself.
        config: valid.
        directory: absolute; need not exist yet.
    """

    def __init__(
        self,
        number: int,
        overrides: Sequence[str],
        template: "_Template",
        values: Mapping[str, Any],
    ) -> None:
        self.number, self.overrides = number, tuple(overrides)
        self.task_overrides = [override for override in overrides if not _is_hydras(override)]
        self._template, self._values = template, values
        self.config = replace(template.config, **values)
        self.directory = Path(os.path.abspath(self._place()))

    def __str__(self) -> str:
        return _name(self.number, self.overrides)

    @property
    def job(self) -> Job:
        """Without Hydra, to be trained."""
        return Job(self.config, self.directory, Path(self._template.sweep_directory).absolute())

    def node(self) -> DictConfig:
        """As Hydra composes it, with the ``hydra`` node. Takes its time."""
        node = self._node()
        with read_write(node.hydra):
            node.hydra.runtime.output_dir = str(self.directory)
        return node

    def _node(self) -> DictConfig:
        node = copy.deepcopy(self._template.node)
        with read_write(node.hydra), open_dict(node.hydra.job):
            node.hydra.job.update(self._of_job())
            node.hydra.overrides.task = self.task_overrides
        for key, value in self._values.items():
            node[key] = value
        return node

    def _of_job(self) -> dict[str, Any]:
        how = self._template.hydra["job"]["config"]["override_dirname"]
        named = [line for line in self.task_overrides if key_of(line) not in how["exclude_keys"]]
        # As Hydra makes it.
        dirname = how["item_sep"].join(sorted(named)).replace("=", how["kv_sep"])
        return {"id": str(self.number), "num": self.number, "override_dirname": dirname}

    def _place(self) -> str:
        """The directory as the user has it."""
        below = self._template.hydra["sweep"]["subdir"]
        for key in ("num", "override_dirname"):
            below = below.replace(f"${{hydra.job.{key}}}", str(self._of_job()[key]))
        if "${" in below:  # something else, which Hydra knows
            below = self._node().hydra.sweep.subdir
        return os.path.join(self._template.sweep_directory, str(below))

    def configuration(self) -> str:
        """The text of its ``.hydra/config.yaml``."""
        return self._template.config_yaml(self._values)

    def write_configuration(self) -> None:
        """Make the directory, and in it the ``.hydra`` that `hydra.core.utils.run_job` makes."""
        self.directory.mkdir(parents=True, exist_ok=True)
        if (folder := self._configuration_directory()) is None:
            return
        folder.mkdir(exist_ok=True)
        clear_leftovers(folder)
        of_each = {
            "job": self._of_job(),
            "overrides": {"task": self.task_overrides},
            "runtime": {"output_dir": str(self.directory)},
        }
        for name, text in {
            "config.yaml": self.configuration(),
            "hydra.yaml": self._template.hydra_yaml(of_each),
            "overrides.yaml": _yaml(self.task_overrides),
        }.items():
            with atomic_write(folder / name, durable=False) as file:
                file.write(text.encode())

    def _configuration_directory(self) -> Path | None:
        name = self._template.hydra["output_subdir"]
        return None if name is None else self.directory / name

    def is_finished(self) -> bool:
        """Whether the directory holds this job's result.

        Raises:
            ConfigError: it holds another job.
        """
        folder = self._configuration_directory()
        if folder is None:  # nothing tells whose result it is
            return False
        try:
            saved = (folder / "config.yaml").read_bytes()
        except FileNotFoundError:
            return False
        if saved != self.configuration().encode() and not self._is_same(saved):
            return False
        if self.config.checkpoint.snapshots and not (self.directory / SNAPSHOTS).exists():
            return False
        return all((self.directory / name).exists() for name in RESULTS)

    def clear(self) -> None:
        """Remove what a kill at the very end has left beside the results."""
        clear_leftovers(self.directory)
        (self.directory / TRAINING).unlink(missing_ok=True)

    def _is_same(self, saved: bytes) -> bool:
        """Whether the text, though not the same, says the same; false if it says nothing.

        Raises:
            ConfigError: it says something else.
        """
        try:
            plain = yaml.safe_load(saved)
        except Exception:  # nearly any, of what isn't YAML
            plain = None
        if not isinstance(plain, dict):  # a crash has left it, empty or broken
            return False
        ours, theirs = flat(yaml.safe_load(self.configuration())), flat(plain)
        for key in ours | theirs:
            if key.partition(".")[0] not in ASIDE and ours.get(key) != theirs.get(key):
                raise ConfigError(
                    f"{self}: {self.directory} holds a job with {key}={theirs.get(key)}, not "
                    f"{key}={ours.get(key)}; name another directory in hydra.sweep.dir"
                )
        return True

    def touch_logs(self) -> None:
        """Make the log files of a job that had nothing to log."""
        for name in self._template.log_files:
            (self.directory / name).touch()


class _Template:
    """What Hydra composed for the first of some jobs, to be filled in for each of them.

    Attributes:
        node: everything.
        config: valid.
        plain: the same, as plain values.
        hydra: the ``hydra`` node, as plain values, interpolations as they stand.
        sweep_directory: as the user has it.
        log_files: of a job, from its directory.
    """

    def __init__(self, node: DictConfig) -> None:
        task = _without_hydra(node)
        self.node, self.config = node, to_config(task)
        self.plain, self.hydra = _plain(task), _plain(node.hydra)
        self.sweep_directory = str(node.hydra.sweep.dir)
        self.log_files = _log_files(node)
        # Most of the text is the same for all.
        self._texts = {key: _yaml({key: value}) for key, value in self.plain.items()}
        self._hydra_texts = {key: _section(key, value) for key, value in self.hydra.items()}

    def config_yaml(self, values: Mapping[str, Any]) -> str:
        """The text of config.yaml, with the per-run values of the one job."""
        return "".join((self._texts | {key: _yaml({key: values[key]}) for key in values}).values())

    def hydra_yaml(self, of_each: Mapping[str, Mapping[str, Any]]) -> str:
        """The text of hydra.yaml, with values of the one job in some of its sections."""
        own = {key: _section(key, self.hydra[key] | values) for key, values in of_each.items()}
        return "hydra:\n" + "".join((self._hydra_texts | own).values())


def compose_jobs(
    loader: ConfigLoader,
    master: DictConfig,
    job_overrides: Sequence[Sequence[str]],
    first: int,
) -> list[SweptJob]:
    """The jobs of a multirun, all of them valid.

    Args:
        loader: Hydra's.
        master: the configuration of the multirun itself.
        job_overrides: of each job, as a sweeper gives them.
        first: the number of the first.

    Raises:
        ConfigError: a job isn't valid; says which, and its overrides.
    """
    templates: dict[tuple[str, ...], _Template] = {}
    jobs = []
    for number, overrides in enumerate(job_overrides, start=first):
        try:
            jobs.append(_compose(loader, master, number, overrides, templates))
        except (AssertionError, ConfigError, HydraException, OmegaConfBaseException) as error:
            if isinstance(error, AssertionError) and not is_of_hydra(error):
                raise
            told = error if isinstance(error, ConfigError) else explain(error, overrides)
            alone = len(job_overrides) == 1
            line = str(told) if alone else f"{_name(number, overrides)}: {told}"
            raise ConfigError(line) from error
    return jobs


def _compose(
    loader: ConfigLoader,
    master: DictConfig,
    number: int,
    overrides: Sequence[str],
    templates: dict[tuple[str, ...], _Template],
) -> SweptJob:
    values = dict(filter(None, map(_number, overrides)))
    kind = tuple(key_of(line) if _number(line) else line for line in overrides)
    template = templates.get(kind)
    if template is None:
        node = loader.load_sweep_config(master, list(overrides))
        template = _Template(node)
        # A value that refers to another is not the same for all.
        if "${" not in template.config_yaml({}):
            templates[kind] = template
    return SweptJob(number, overrides, template, values)


def _number(override: str) -> tuple[str, float] | None:
    """The key and the value of an override that sets a per-run value to a number."""
    for pattern, kind in _NUMBERS:
        if match := pattern.fullmatch(override):
            return match[1], kind(match[2])
    return None


def _without_hydra(node: DictConfig) -> DictConfig:
    return OmegaConf.masked_copy(node, [str(key) for key in node if key != "hydra"])


def _log_files(node: DictConfig) -> list[str]:
    hydra = copy.deepcopy(node).hydra
    with read_write(hydra):
        hydra.runtime.output_dir = "."
    handlers = (hydra.job_logging or {}).get("handlers") or {}
    return [handler.filename for handler in handlers.values() if "filename" in handler]


def _name(number: int, overrides: Sequence[str]) -> str:
    return f"job {number} ({' '.join(overrides)})"


def _is_hydras(override: str) -> bool:
    return key_of(override).startswith(("hydra.", "hydra/"))


def _plain(node: Any) -> Any:
    return OmegaConf.to_container(node, enum_to_str=True)


def _section(key: str, value: object) -> str:
    return _yaml({"hydra": {key: value}}).partition("\n")[2]


def _yaml(plain: object) -> str:
    return yaml.dump(
        plain, Dumper=_Dumper, default_flow_style=False, allow_unicode=True, sort_keys=False
    )
