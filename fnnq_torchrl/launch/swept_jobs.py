"""The jobs of a Hydra multirun. Jobs that differ only in per-run values are composed once.

Composing a job with Hydra takes a tenth of a second or more, longer than many jobs learn.
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
from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from fnnq_torchrl.config.checking import flat, to_config
from fnnq_torchrl.config.identity import ASIDE
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.files.atomic import atomic_write, clear_leftovers
from fnnq_torchrl.files.settings import parse_settings
from fnnq_torchrl.launch.composition import composing, key_of, offer_own_step_sizes
from fnnq_torchrl.training.jobs import BATCHABLE, RESULTS, SNAPSHOTS, TRAINING, Job

_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")

_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # the one in C is faster


class _Template:
    """The configuration of one job, from which jobs with other per-run values are made.

    Args:
        node: the configuration that Hydra composed, with the ``hydra`` node.

    Attributes:
        node: the same, with ``hydra.runtime.output_dir`` set.
        config: the valid configuration, without the ``hydra`` node.
        task: all but the ``hydra`` node, as plain values with unresolved interpolations.
        hydra: the ``hydra`` node, as plain values with unresolved interpolations.
        sweep_directory: the absolute path of the sweep's directory.
        log_files: the paths of a job's log files, relative to the job's directory.
    """

    def __init__(self, node: DictConfig) -> None:
        task = OmegaConf.masked_copy(node, [str(key) for key in node if key != "hydra"])
        self.node, self.config = node, to_config(task, own=True)
        self.task, self.hydra = _plain(task), _plain(node.hydra)
        self.sweep_directory = Path(node.hydra.sweep.dir).absolute()
        with read_write(node.hydra):
            node.hydra.runtime.output_dir = "."
        handlers = (node.hydra.job_logging or {}).get("handlers") or {}
        self.log_files = [each.filename for each in handlers.values() if "filename" in each]
        # Made once, because most of the text is the same in all jobs.
        self._task_texts = {key: _yaml({key: value}) for key, value in self.task.items()}
        self._hydra_texts = {key: _section(key, value) for key, value in self.hydra.items()}

    def config_yaml(self, values: Mapping[str, float]) -> str:
        """Return the text of the config.yaml of a job with these per-run values."""
        own = {key: _yaml({key: value}) for key, value in values.items()}
        return "".join((self._task_texts | own).values())

    def hydra_yaml(self, sections: Mapping[str, Mapping[str, Any]]) -> str:
        """Return the text of a job's hydra.yaml, with these values in these sections."""
        own = {key: _section(key, self.hydra[key] | sections[key]) for key in sections}
        return "hydra:\n" + "".join((self._hydra_texts | own).values())


class SweptJob:
    """One job of a multirun.

    Attributes:
        number: the job's number in its sweep.
        overrides: the job's overrides, as the sweeper gave them.
        task_overrides: the overrides without those of ``hydra`` keys.
        config: the job's valid configuration.
        directory: the absolute path of the job's directory, which need not exist yet.
    """

    def __init__(
        self, number: int, overrides: Sequence[str], template: _Template, values: dict[str, Any]
    ) -> None:
        self.number, self.overrides = number, tuple(overrides)
        self.task_overrides = [
            line for line in overrides if not key_of(line).startswith(("hydra.", "hydra/"))
        ]
        self.config = replace(template.config, **values)
        self._template, self._values = template, values
        # The names and the directory are those that Hydra would give.
        hydra = template.hydra
        how = hydra["job"]["config"]["override_dirname"]
        named = [line for line in self.task_overrides if key_of(line) not in how["exclude_keys"]]
        dirname = how["item_sep"].join(sorted(named)).replace("=", how["kv_sep"])
        self._names = {"id": str(number), "num": number, "override_dirname": dirname}
        below = hydra["sweep"]["subdir"]
        for key, value in self._names.items():
            below = below.replace(f"${{hydra.job.{key}}}", str(value))
        if "${" in below:
            below = self.node().hydra.sweep.subdir
        self.directory = Path(os.path.abspath(template.sweep_directory / str(below)))
        self._hydra_directory = self.directory / (hydra["output_subdir"] or ".hydra")

    def __str__(self) -> str:
        return f"job {self.number} ({' '.join(self.overrides)})"

    @property
    def job(self) -> Job:
        """The job to train: configuration, directory and sweep directory."""
        return Job(self.config, self.directory, self._template.sweep_directory)

    def node(self) -> DictConfig:
        """Return the job's configuration as Hydra composes it, with the ``hydra`` node; slow."""
        node = copy.deepcopy(self._template.node)
        with read_write(node.hydra), open_dict(node.hydra.job):
            node.hydra.job.update(self._names)
            node.hydra.overrides.task = self.task_overrides
        node.update(self._values)
        return node

    def write_configuration(self) -> None:
        """Make the directory, and write the ``.hydra`` files that Hydra's ``run_job`` writes."""
        self._hydra_directory.mkdir(parents=True, exist_ok=True)
        clear_leftovers(self._hydra_directory)
        sections = {
            "job": self._names,
            "overrides": {"task": self.task_overrides},
            "runtime": {"output_dir": str(self.directory)},
        }
        for name, text in (
            ("config.yaml", self._template.config_yaml(self._values)),
            ("hydra.yaml", self._template.hydra_yaml(sections)),
            ("overrides.yaml", _yaml(self.task_overrides)),
        ):
            with atomic_write(self._hydra_directory / name, durable=False) as file:
                file.write(text.encode())

    def is_finished(self) -> bool:
        """Return whether the directory holds this job's results.

        Raises:
            ConfigError: if the directory holds another job.
        """
        try:
            saved = (self._hydra_directory / "config.yaml").read_bytes()
        except FileNotFoundError:
            return False
        if saved != self._template.config_yaml(self._values).encode():
            plain = parse_settings(saved)
            if plain is None:  # cut short by a crash
                return False
            self._refuse_another(flat(plain))
        results = (*RESULTS, SNAPSHOTS) if self.config.checkpoint.snapshots else RESULTS
        return all((self.directory / name).exists() for name in results)

    def _refuse_another(self, saved: dict[str, Any]) -> None:
        own = flat(self._template.task | self._values)
        for key in own | saved:
            if key.partition(".")[0] not in ASIDE and own.get(key) != saved.get(key):
                raise ConfigError(
                    f"{self}: {self.directory} holds a job with {key}={saved.get(key)}, not "
                    f"{key}={own.get(key)}; name another directory in hydra.sweep.dir"
                )

    def clear(self) -> None:
        """Remove temporary files if the job was killed after it had written its results."""
        clear_leftovers(self.directory)
        (self.directory / TRAINING).unlink(missing_ok=True)

    def touch_logs(self) -> None:
        """Make the log files of a job, empty if they don't exist."""
        for name in self._template.log_files:
            (self.directory / name).touch()


Templates = dict[tuple[str, ...], _Template]
"""The configurations that Hydra has composed, by their overrides without per-run values."""


def compose_jobs(
    loader: ConfigLoader,
    master: DictConfig,
    job_overrides: Sequence[Sequence[str]],
    first: int,
    templates: Templates,
) -> list[SweptJob]:
    """Compose jobs of a multirun, and check them.

    Args:
        loader: Hydra's loader of configurations.
        master: the configuration of the multirun itself.
        job_overrides: the overrides of each job, as a sweeper gives them.
        first: the number of the first job.
        templates: those of the multirun's earlier jobs; those of these jobs are added.

    Raises:
        ConfigError: if a job isn't valid; of several jobs, the message names the job.
    """

    def compose(number: int, overrides: Sequence[str]) -> SweptJob:
        values = dict(filter(None, map(_number, overrides)))
        kind = tuple(key_of(line) if _number(line) else line for line in overrides)
        template = templates.get(kind)
        if template is None:
            offer_own_step_sizes(overrides, again=False)  # a preset may name some that aren't typed
            template = _Template(loader.load_sweep_config(master, list(overrides)))
            # An interpolated value may depend on a per-run value, so it can't be shared.
            if "${" not in template.config_yaml({}):
                templates[kind] = template
        return SweptJob(number, overrides, template, values)

    jobs = []
    for number, overrides in enumerate(job_overrides, start=first):
        try:
            with composing(overrides):
                jobs.append(compose(number, overrides))
        except ConfigError as error:
            if len(job_overrides) == 1:
                raise
            raise ConfigError(f"job {number} ({' '.join(overrides)}): {error}") from error
    return jobs


def _number(override: str) -> tuple[str, float] | None:
    """Return the key and the value of an override that sets a per-run key to a number, or None.

    These overrides are applied without Hydra; it composes all others.
    """
    key, _, text = override.partition("=")
    if key in ("seed", "num_seeds"):
        return (key, int(text)) if text.isdecimal() else None
    return (key, float(text)) if key in BATCHABLE and _DECIMAL.fullmatch(text) else None


def _plain(node: Any) -> Any:
    return OmegaConf.to_container(node, enum_to_str=True)


def _section(key: str, value: object) -> str:
    return _yaml({"hydra": {key: value}}).partition("\n")[2]


def _yaml(plain: object) -> str:
    how: Any = {"default_flow_style": False, "allow_unicode": True, "sort_keys": False}
    try:
        text: str = yaml.dump(plain, Dumper=_Dumper, **how)
    except UnicodeEncodeError:
        # The name of a directory isn't UTF-8, which the dumper in C can't write.
        text = yaml.dump(plain, Dumper=yaml.SafeDumper, **how)
    return text
