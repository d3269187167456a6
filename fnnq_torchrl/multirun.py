"""The jobs of a Hydra multirun, composed once for all that differ only in per-run values.

Hydra takes a tenth of a second and more to compose a job, which is longer than many a job learns.
"""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml
from hydra.core.config_loader import ConfigLoader
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from fnnq_torchrl.batches import Job
from fnnq_torchrl.compose import explain, key_of
from fnnq_torchrl.config import Config, ConfigError, to_config

_WHOLE, _DECIMAL = r"0|[1-9]\d*", r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_NUMBERS = [
    (re.compile(f"(seed|num_seeds)=({_WHOLE})"), int),
    (re.compile(f"(lam|alpha|alpha_decay|gamma|epsilon)=({_DECIMAL})"), float),
]
"""The overrides that need no composing; whatever else may be said is Hydra's business."""

# Of the hydra node, what differs from job to job.
_OF_EACH_JOB = ("job", "overrides", "runtime")

_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # in C where it is to be had


class SweptJob:
    """One job of a multirun.

    Attributes:
        number: of the job in its sweep.
        overrides: those that its sweeper gave it.
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
        self._template, self._values = template, values
        self.config = replace(template.config, **values)
        self.directory = Path(self.node.hydra.runtime.output_dir)

    def __str__(self) -> str:
        return _name(self.number, self.overrides)

    @property
    def job(self) -> Job:
        """Without Hydra, to be trained."""
        return Job(self.config, self.directory)

    @property
    def node(self) -> DictConfig:
        """As Hydra composes it, with the ``hydra`` node; good until another job's is asked for."""
        return self._template.filled(self.number, self.overrides, self._values)

    def configuration(self) -> str:
        """The text of its ``.hydra/config.yaml``."""
        return self._template.configuration(self._values)

    def write_configuration(self) -> None:
        """Make the directory, and in it the ``.hydra`` that `hydra.core.utils.run_job` makes."""
        hydra = self.node.hydra
        self.directory.mkdir(parents=True, exist_ok=True)
        if hydra.output_subdir is None:
            return
        folder = self.directory / hydra.output_subdir
        folder.mkdir(exist_ok=True)
        texts = {
            "config.yaml": self.configuration(),
            "hydra.yaml": self._template.hydra(),
            "overrides.yaml": _yaml(_plain(hydra.overrides.task)),
        }
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")

    def is_finished(self) -> bool:
        """Whether the directory holds this job's result.

        Raises:
            ConfigError: it holds another job.
        """
        subdirectory = self._template.node.hydra.output_subdir
        if subdirectory is None:  # nothing tells whose result it is
            return False
        try:
            saved = (self.directory / subdirectory / "config.yaml").read_text(encoding="utf-8")
        except FileNotFoundError:
            return False
        if saved != self.configuration():
            self._check_saved(saved)
        return (self.directory / "summary.json").exists()  # the last file that a job writes

    def _check_saved(self, saved: str) -> None:
        """That the texts, though not the same, say the same."""
        ours, theirs = (_flat(yaml.safe_load(text)) for text in (self.configuration(), saved))
        for key in ours | theirs:
            if ours.get(key) != theirs.get(key):
                raise ConfigError(
                    f"{self}: {self.directory} holds a job with {key}={theirs.get(key)}, not "
                    f"{key}={ours.get(key)}; name another directory in hydra.sweep.dir"
                )


@dataclass
class _Template:
    """What Hydra composed for the first of some jobs, to be filled in for each of them."""

    node: DictConfig
    config: Config

    def __post_init__(self) -> None:
        plain = _plain(self.node)
        hydra = plain.pop("hydra")
        self._plain = plain
        self._common = {
            key: _section(key, value) for key, value in hydra.items() if key not in _OF_EACH_JOB
        }
        self._keys = list(hydra)

    def filled(
        self, number: int, overrides: Sequence[str], values: Mapping[str, float]
    ) -> DictConfig:
        node, hydra = self.node, self.node.hydra
        task = [override for override in overrides if not _is_hydras(override)]
        with read_write(hydra), open_dict(hydra.job):
            for key, value in values.items():
                node[key] = value
            hydra.job.id, hydra.job.num = str(number), number
            hydra.overrides.task = task
            hydra.job.override_dirname = _override_dirname(task, hydra.job.config.override_dirname)
            directory = os.path.join(str(hydra.sweep.dir), str(hydra.sweep.subdir))
            hydra.runtime.output_dir = os.path.abspath(directory)
        return node

    def configuration(self, values: Mapping[str, float]) -> str:
        return _yaml(self._plain | values)

    def hydra(self) -> str:
        """The text of hydra.yaml for the job that was filled in last."""
        own = {key: _plain(self.node.hydra[key]) for key in _OF_EACH_JOB}
        texts = self._common | {key: _section(key, value) for key, value in own.items()}
        return "hydra:\n" + "".join(texts[key] for key in self._keys)


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
        except (ConfigError, HydraException, OmegaConfBaseException) as error:
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
    kind = tuple(override for override in overrides if not _number(override))
    template = templates.get(kind)
    if template is None:
        node = loader.load_sweep_config(master, list(overrides))
        template = _Template(node, to_config(_without_hydra(node)))
        # A value that refers to another is not the same for all.
        if not _refers(node):
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


def _refers(node: DictConfig) -> bool:
    return "${" in OmegaConf.to_yaml(_without_hydra(node))


def _name(number: int, overrides: Sequence[str]) -> str:
    return f"job {number} ({' '.join(overrides)})"


def _is_hydras(override: str) -> bool:
    return key_of(override).startswith(("hydra.", "hydra/"))


def _override_dirname(overrides: Sequence[str], how: DictConfig) -> str:
    """What Hydra makes of a job's overrides for ``${hydra.job.override_dirname}``."""
    lines = [line for line in overrides if key_of(line) not in how.exclude_keys]
    return str(how.item_sep).join(sorted(lines)).replace("=", how.kv_sep)


def _plain(node: Any) -> Any:
    return OmegaConf.to_container(node, enum_to_str=True)


def _section(key: str, value: object) -> str:
    return _yaml({"hydra": {key: value}}).partition("\n")[2]


def _yaml(plain: object) -> str:
    return yaml.dump(
        plain, Dumper=_Dumper, default_flow_style=False, allow_unicode=True, sort_keys=False
    )


def _flat(plain: object, prefix: str = "") -> dict[str, object]:
    """Nested mappings by dotted keys."""
    if not isinstance(plain, dict):
        return {prefix.removesuffix("."): plain}
    return {
        key: value
        for name, below in plain.items()
        for key, value in _flat(below, f"{prefix}{name}.").items()
    }
