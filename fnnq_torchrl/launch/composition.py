"""Composes overrides such as ``lam=0.2`` into a valid `Config`, or explains what is wrong."""

import difflib
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from inspect import signature

from hydra import compose, version
from hydra._internal.utils import create_config_search_path
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, ValueType
from hydra.core.utils import JobRuntime
from hydra.errors import (
    MissingConfigException,
    OverrideParseException,
)
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from envs.core.parameters import allowed
from envs.core.registry import is_own
from fnnq_torchrl.config.checking import refusal, to_config
from fnnq_torchrl.config.choices import choices_of, config_directory
from fnnq_torchrl.config.launcher import LauncherConfig
from fnnq_torchrl.config.schema import Config, ConfigError, OutOfRange
from fnnq_torchrl.config.search import SearchConfig
from fnnq_torchrl.launch.from_job import SAVED, choose_primary
from fnnq_torchrl.launch.loader import start_hydra
from hydra_plugins.fnnq_torchrl import BatchLauncher, BatchSweeper, OptunaSweeper

VERSION_BASE = "1.3"  # the version of Hydra whose defaults apply

_PLUGINS: dict[tuple[str, str], list[str]] = {
    ("launcher", BatchLauncher.__name__): [*allowed(LauncherConfig)],
    ("sweeper", BatchSweeper.__name__): [*signature(BatchSweeper).parameters],
    ("sweeper", OptunaSweeper.__name__): ["params", *allowed(SearchConfig)],
}
"""The allowed keys of our launcher and sweepers, by Hydra's group and the name of the class."""

_OPEN = "step_size"
"""The group of which a class of the user's is a choice, too."""

# conf/config.yaml begins with this schema: Hydra then refuses unknown keys and wrong types.
ConfigStore.instance().store(name="schema", node=Config)


def load_config(*overrides: str) -> Config:
    """Return the configuration that the train command would use with these overrides.

    ``load_config("lam=0.8", "seed=3")`` also works inside another Hydra application.

    Args:
        *overrides: overrides as on the command line, each with a single value.

    Raises:
        ConfigError: if a key is unknown or its value isn't allowed.
    """
    offer_own_step_sizes(overrides)
    primary, others = choose_primary(overrides)
    with composing(others), started_hydra():
        refuse_several_values(others)
        return to_config(compose(primary, others), own=True)


def offer_own_step_sizes(overrides: Sequence[str], *, again: bool = True) -> None:
    """Add the user's classes in ``step_size=module:Class`` to the choices of this group.

    The other keys that can name a class aren't groups, so Hydra takes any text for them. A step
    size of the user's has the settings of ``step_size=constant``, unless more are given.

    Args:
        overrides: the overrides that will be composed.
        again: False to leave a class alone that is among the choices, perhaps with a job's values.
    """
    for line in overrides:
        if key_of(line) != _OPEN:
            continue
        for kind in re.findall(r"[\w.]+:\w+", line.replace("\\:", ":")):
            node = {"defaults": ["constant", "_self_"], _OPEN: kind}
            store = ConfigStore.instance()
            if again or f"{kind}.yaml" not in store.repo.get(_OPEN, {}):
                store.store(name=kind, node=node, group=_OPEN, package="_global_")


@contextmanager
def composing(overrides: Sequence[str]) -> Iterator[None]:
    """Turn any error of the block, which composes a configuration, into a `ConfigError`.

    Args:
        overrides: the overrides that the block composes.

    Raises:
        ConfigError: if the block fails; the message is one line.
    """
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:
        raise explain(error, overrides) from error


def explain(error: Exception, overrides: Sequence[str]) -> ConfigError:
    """Return a one-line `ConfigError` for an error of Hydra; if possible, it says what is allowed.

    Args:
        error: the error raised while a configuration was composed. Most are Hydra's or OmegaConf's
            own; on some input, Hydra fails with other errors.
        overrides: the overrides that were composed.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
    except OverrideParseException as wrong:
        return ConfigError(f"{wrong.override}: {_advice_on_parsing(wrong.override, overrides)}")
    message = " ".join(str(error).split())
    message = message or f"Hydra fails with {type(error).__name__}; HYDRA_FULL_ERROR=1 shows where"
    causes = (error.__cause__, error.__context__)  # Hydra sets one or the other
    cause = next((each for each in causes if isinstance(each, OmegaConfBaseException)), error)
    if isinstance(cause, OmegaConfBaseException):
        key = cause.full_key or "hydra"
        if key.partition(".")[0] == "hydra":
            return ConfigError(message + _advice_on_hydra(key))
        typed = [line.partition("=")[2] for line in overrides if key_of(line) == key]
        return refusal(cause, typed[0] if typed else None)
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        # Hydra gives no options if the choice was typed in a list.
        if options := [
            each
            for each in error.options or choices_of(group)
            if each != SAVED and not each.startswith("_") and not is_own(each)
        ]:
            options += ["your own module:Class"] * (group == _OPEN)
            return OutOfRange(group, choice, " or ".join(options))
    return _misuse_of_a_group(parsed) or ConfigError(message)


def refuse_several_values(overrides: Sequence[str]) -> None:
    """Refuse overrides with several values, in a command for a single job.

    Raises:
        ConfigError: if an override has several values.
    """
    for override in OverridesParser.create().parse_overrides(list(overrides)):
        if override.is_sweep_override():
            raise ConfigError(f"{override.input_line}: several values need -m, a job for each")


def _advice_on_parsing(override: str, overrides: Sequence[str]) -> str:
    """Return advice on an unreadable override: often it was split at a space in parentheses."""
    if override.count("(") <= override.count(")"):
        return "can't be read as key=value"
    begin = overrides.index(override)
    for end in range(begin + 1, len(overrides) + 1):
        whole = " ".join(overrides[begin:end])
        if whole.count("(") == whole.count(")"):
            return f"parentheses need quotes; type '{whole}'"
    return "its parenthesis isn't closed; type it in quotes, as in 'seed=range(22)'"


def check_plugins(hydra: DictConfig) -> None:
    """Refuse unknown keys of our launcher and sweeper, which Hydra itself may not check.

    Args:
        hydra: the ``hydra`` node of a composed configuration.

    Raises:
        ConfigError: if a key is unknown.
    """
    for (name, plugin), known in _PLUGINS.items():
        settings = hydra[name]
        if settings.get("_target_") == f"{BatchLauncher.__module__}.{plugin}":
            for key in {*map(str, settings)} - {"_target_", *known}:
                whole = f"hydra.{name}.{key}"
                raise ConfigError(f"{whole}: there is no such key{_advice_on_hydra(whole)}")


def _advice_on_hydra(key: str) -> str:
    """Return a suggestion for a misspelt key of our launcher or sweepers, or an empty text."""
    group, _, name = key.rpartition(".")
    known = [
        each
        for (plugged, _), keys in _PLUGINS.items()
        if group == f"hydra.{plugged}"
        for each in keys
    ]
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {group}.{near[0]}?" if near else ""


def _misuse_of_a_group(overrides: Sequence[Override]) -> ConfigError | None:
    """Return the error for ``env=null`` or for a key of a logger that isn't chosen, else None."""
    loggers = " ".join(str(each.input_line) for each in overrides if each.key_or_group == "logger")
    for override in overrides:
        key, line = override.key_or_group, override.input_line
        is_name = isinstance(override.value(), str | list)
        if override.value_type is ValueType.ELEMENT and choices_of(key) and not is_name:
            return OutOfRange(key, override.get_value_string(), " or ".join(choices_of(key)))
        group, _, below = key.partition(".")
        name = below.partition(".")[0]
        if group == "logger" and name and name not in loggers:
            return ConfigError(f"{line}: {name} isn't chosen; 'logger=[csv,{name}]' chooses it")
    return None


def key_of(override: str) -> str:
    """Return the key of an override: ``lam`` of ``lam=0.2`` or ``+lam=0.2``."""
    return override.lstrip("+~").partition("=")[0]


@contextmanager
def started_hydra() -> Iterator[None]:
    """Initialise Hydra with our ``conf/`` in a block, and restore its global state afterwards."""
    hydra, base = GlobalHydra.instance().hydra, version.getbase()
    GlobalHydra.instance().clear()
    try:
        version.setbase(VERSION_BASE)
        path = create_config_search_path(str(config_directory()))
        start_hydra(JobRuntime.instance().get("name"), path)
        yield
    finally:
        GlobalHydra.instance().hydra = hydra
        version.VersionBase.instance().version_base = base
