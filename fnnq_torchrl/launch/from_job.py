"""``from=DIR`` on the command line: an earlier job's configuration, taken as data.

To Hydra it is one more choice of every group, and the other arguments change it as they change what
is in ``conf/``.
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
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.config.values import LabelsConfig

SAVED = "saved"
"""The name of the job's configuration to Hydra, as a whole and as a choice of every group."""

_WORD = "from="

_OF_TASK = ("env", "action", "evaluation")
"""The groups that a task chooses."""


def choose_primary(arguments: Sequence[str]) -> tuple[str, list[str]]:
    """Take ``from=DIR`` out of a command's arguments.

    Args:
        arguments: as typed.

    Returns:
        The name of the primary configuration for Hydra to compose, and the other arguments.

    Raises:
        ConfigError: the directory isn't a job's, or its configuration can't be used.
    """
    others = [argument for argument in arguments if not argument.startswith(_WORD)]
    words = [argument for argument in arguments if argument.startswith(_WORD)]
    if not words:
        return "config", others
    if len(words) > 1:
        raise ConfigError(f"{' '.join(words)}: must be one job")
    directory = Path(words[0].removeprefix(_WORD))
    _store(saved_config(directory, others), _saved_task(directory))
    return SAVED, others


def saved_config(directory: Path, typed: Sequence[str] = ()) -> Config:
    """Return the configuration of a finished or begun job. Nothing in it is run.

    Args:
        directory: the job's.
        typed: what the user has typed. A class of a user's own is imported only if it is named here
            too, as ``value.kind=module:Class``.

    Raises:
        ConfigError: there is no configuration there, it is damaged, or isn't valid today.
    """
    path = directory / ".hydra" / "config.yaml"
    if not directory.is_dir():
        raise ConfigError(f"{_WORD}{directory}: there is no such directory")
    if not path.is_file():
        raise ConfigError(
            f"{_WORD}{directory}: has no .hydra/config.yaml; name the directory of one job"
        )
    plain = parse_configuration(path.read_bytes())
    if plain is None:
        raise ConfigError(f"{path} is not a configuration, or a damaged one")
    for key, value in flat(plain).items():
        if re.search(r"\$\{.*:", str(value)):  # calls a function
            raise ConfigError(f"{path}: {key}={value}: must be a plain value")
        if key.endswith(".kind") and is_own(value) and f"{key}={value}" not in typed:
            raise ConfigError(
                f"{path}: {key}={value} is somebody's own code; if you trust it, type that too"
            )
    plain.pop("logger", None)  # nobody logs where somebody else says
    try:
        config = to_config(plain, own=True)
    except (ConfigError, OmegaConfBaseException) as error:
        raise ConfigError(f"{path}: {str(error).splitlines()[0]}") from error
    for key, value in flat(asdict(config)).items():
        if "${" in str(value):  # put together from harmless parts
            raise ConfigError(f"{path}: {key}={value}: must be a plain value")
    return config


def parse_configuration(text: bytes) -> dict[str, Any] | None:
    """Return the content of a ``config.yaml`` as plain data, or None if it is damaged."""
    try:
        plain = yaml.safe_load(text)
    except Exception:  # nearly any, of what isn't YAML
        return None
    return plain if isinstance(plain, dict) else None


def _saved_task(directory: Path) -> str:
    """Return the task that the job was given; the default one if that can't be told."""
    path = directory / ".hydra" / "hydra.yaml"
    found: Any = parse_configuration(path.read_bytes()) if path.is_file() else None
    for key in ("hydra", "runtime", "choices", "task"):
        found = found.get(key) if isinstance(found, dict) else None
    return found if isinstance(found, str) and found.isidentifier() else "follow"


def _labels(config: Config, task: str) -> dict[str, Any]:
    """Return the labels for another value function: those of the job's, or of its task."""
    value = asdict(config.value)
    if isinstance(config.value, LabelsConfig):
        return {key: value[key] for key in ("inputs", "action", "names")}
    known = task in choices_of("value/labels")
    return {"defaults": [f"/value/labels/{task}@_here_"]} if known else {}


def _store(config: Config, task: str) -> None:
    """Give Hydra a configuration in the form of ``conf/config.yaml`` and its groups.

    Args:
        config: the job's.
        task: the job's, whose labels another value function would have.
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
            choice = None  # its keys are among the others, until a choice of it is typed
        defaults.append({group: choice})
    store.store(name=SAVED, node=values | {"hydra": primary["hydra"], "defaults": defaults})
