"""``from=DIR`` on the command line: takes the configuration of an earlier job, as data.

That configuration is given to Hydra as one more choice of every group. So the other overrides
change it in the same way as they change ``conf/``.
"""

import re
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml
from hydra.core.config_store import ConfigStore
from omegaconf.errors import OmegaConfBaseException

from envs.core.registry import is_own
from fnnq_torchrl.config.checking import flat, to_config
from fnnq_torchrl.config.choices import choices_of, config_directory
from fnnq_torchrl.config.own import names_code
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.files.settings import parse_settings

SAVED = "saved"
"""Hydra's name for the job's configuration, both for the whole and as a choice of a group."""

_WORD = "from="

_OF_TASK = ("env", "action", "evaluation")
"""The configuration groups whose choices a task sets."""


def choose_primary(arguments: Sequence[str]) -> tuple[str, list[str]]:
    """Take ``from=DIR`` out of a command's arguments.

    Args:
        arguments: the arguments as typed.

    Returns:
        The name of the primary configuration for Hydra to compose, and the other arguments.

    Raises:
        ConfigError: if there are two ``from=``, the directory isn't that of a job, or the job's
            configuration can't be used.
    """
    others = [argument for argument in arguments if not argument.startswith(_WORD)]
    words = [argument for argument in arguments if argument.startswith(_WORD)]
    if not words:
        return "config", others
    if len(words) > 1:
        raise ConfigError(f"{' '.join(words)}: name one job")
    directory = Path(words[0].removeprefix(_WORD))
    _store(saved_config(directory, others), _saved_task(directory))
    return SAVED, others


def saved_config(directory: Path, typed: Sequence[str] = ()) -> Config:
    """Return the configuration of a job, finished or not, without running anything in it.

    Args:
        directory: the job's directory.
        typed: the overrides that the user has typed. A class from outside this package is imported
            only if these name it, too, as in ``value.kind=module:Class``.

    Raises:
        ConfigError: if the directory has no configuration, or it is damaged or no longer valid.
    """
    path = directory / ".hydra" / "config.yaml"
    if not directory.is_dir():
        raise ConfigError(f"{_WORD}{directory}: there is no such directory")
    if not path.is_file():
        raise ConfigError(
            f"{_WORD}{directory}: has no .hydra/config.yaml; name the directory of one job"
        )
    named = {line.lstrip("+") for line in typed}
    plain = parse_settings(path.read_bytes())
    if plain is None:
        raise ConfigError(f"{path} is damaged, or not a configuration")
    for key, value in flat(plain).items():
        if re.search(r"\$\{.*:", str(value)):  # a resolver, which is a function call
            raise ConfigError(f"{path}: {key}={value}: must be a plain value")
        if names_code(key, value) and f"{key}={value}" not in named:
            raise ConfigError(
                f"{path}: {key}={value} names code from outside fnnq_torchrl; "
                f"if you trust it, add {key}={value} to the command"
            )
    plain.pop("logger", None)  # a file from elsewhere must not choose where to log
    try:
        config = to_config(plain, own=True)
    except (ConfigError, OmegaConfBaseException) as error:
        raise ConfigError(f"{path}: {str(error).splitlines()[0]}") from error
    for key, value in flat(asdict(config)).items():
        if "${" in str(value):  # interpolations that only together form a reference
            raise ConfigError(f"{path}: {key}={value}: must be a plain value")
    return config


def _saved_task(directory: Path) -> str:
    """Return the name of the job's task, or the default task if the directory has none."""
    path = directory / ".hydra" / "hydra.yaml"
    found: Any = parse_settings(path.read_bytes()) if path.is_file() else None
    for key in ("hydra", "runtime", "choices", "task"):
        found = found.get(key) if isinstance(found, dict) else None
    return found if isinstance(found, str) and found.isidentifier() else "follow"


def _labels(config: Config, task: str) -> dict[str, Any]:
    """Return the labels for another value function: those of the job or else of its task."""
    value = asdict(config.value)
    if isinstance(config.value, LabelsConfig):
        return {key: value[key] for key in ("inputs", "action", "names")}
    known = task in choices_of("value/labels")
    return {"defaults": [f"/value/labels/{task}@_here_"]} if known else {}


def _store(config: Config, task: str) -> None:
    """Register a configuration with Hydra, in the form of ``conf/config.yaml`` and its groups.

    Args:
        config: the job's configuration.
        task: the name of the job's task.
    """
    primary = yaml.safe_load((config_directory() / "config.yaml").read_bytes())
    values, store = asdict(config), ConfigStore.instance()
    store.store(group="value/labels", name=SAVED, node=_labels(config, task))
    bundle = {"defaults": [{f"/{group}": SAVED} for group in _OF_TASK]}
    store.store(group="task", name=SAVED, node=bundle, package="_global_")
    for group in _OF_TASK:
        store.store(group=group, name=SAVED, node=values.pop(group))
    defaults: list[str | dict[str, str | None]] = []
    for default in primary["defaults"]:
        if isinstance(default, str):
            defaults.append(default)
            continue
        [(group, choice)] = default.items()
        if group in values and values[group] is None:  # an older job: as by default
            del values[group]
        elif isinstance(values.get(group), dict):
            store.store(group=group, name=SAVED, node=values.pop(group))
            choice = SAVED
        elif group == "task":
            choice = SAVED
        elif not group.startswith(("override ", "optional ")):
            choice = None  # its values are top-level keys, unless a choice is typed
        defaults.append({group: choice})
    if is_own(config.step_size):  # a choice that is typed again changes nothing
        store.store(group="step_size", name=config.step_size, node={}, package="_global_")
    store.store(name=SAVED, node=values | {"hydra": primary["hydra"], "defaults": defaults})
