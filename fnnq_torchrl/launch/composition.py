"""From overrides such as ``lam=0.2`` to a valid `Config`, and what to say when there is none."""

import difflib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from hydra import compose, initialize_config_dir, version
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, ValueType
from hydra.core.utils import JobRuntime
from hydra.errors import (
    ConfigCompositionException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf.errors import OmegaConfBaseException

from envs.core.parameters import allowed
from fnnq_torchrl.config.checking import refusal, to_config
from fnnq_torchrl.config.choices import choices_of, config_directory
from fnnq_torchrl.config.launcher import LauncherConfig
from fnnq_torchrl.config.schema import Config, ConfigError, OutOfRange
from fnnq_torchrl.launch.from_job import SAVED, choose_primary

VERSION_BASE = "1.3"  # of Hydra, whose defaults change with it

# conf/config.yaml begins with this schema: Hydra then refuses unknown keys and wrong types.
ConfigStore.instance().store(name="schema", node=Config)


def load_config(*overrides: str) -> Config:
    """Return the configuration that a command would train with.

    ``load_config("lam=0.8", "seed=3")`` works anywhere, inside another Hydra application too.

    Args:
        *overrides: as on the command line, without sweeps.

    Raises:
        ConfigError: a key is unknown or its value isn't allowed.
    """
    primary, others = choose_primary(overrides)
    with composing(others), _hydra():
        return to_config(compose(primary, others), own=True)


@contextmanager
def composing(overrides: Sequence[str]) -> Iterator[None]:
    """A block in which a configuration is composed: what fails in it is in what was typed.

    Args:
        overrides: what it is composed of.

    Raises:
        ConfigError: the error in one line.
    """
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:
        raise explain(error, overrides) from error


def explain(error: Exception, overrides: Sequence[str], *, multirun: bool = False) -> ConfigError:
    """Return one line for an error on which Hydra spends several, without saying what is allowed.

    Args:
        error: raised while a configuration was composed. Mostly it is Hydra's or OmegaConf's own,
            but Hydra stumbles over some input by errors of other kinds.
        overrides: what it was composed of.
        multirun: the overrides are those of a sweep.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
    except OverrideParseException as wrong:
        return ConfigError(f"{wrong.override}: {_advice_on_parsing(wrong.override, overrides)}")
    message = " ".join(str(error).split())
    message = message or f"Hydra fails with {type(error).__name__}; HYDRA_FULL_ERROR=1 shows where"
    cause = error.__cause__ if isinstance(error.__cause__, OmegaConfBaseException) else error
    if isinstance(cause, OmegaConfBaseException):
        key = cause.full_key or "hydra"
        if key.partition(".")[0] == "hydra":
            return ConfigError(message + _advice_on_hydra(key))
        typed = [line.partition("=")[2] for line in overrides if key_of(line) == key]
        return refusal(cause, typed[0] if typed else None)
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        # Hydra doesn't say what else there is if the choice stands in a list.
        if options := [
            each
            for each in error.options or choices_of(group)
            if each != SAVED and not each.startswith("_")
        ]:
            return OutOfRange(group, choice, " or ".join(options))
    if isinstance(error, ConfigCompositionException) and not multirun:
        for override in parsed:
            if override.is_sweep_override():
                line = override.input_line
                return ConfigError(f"{line}: several values need -m, a job for each")
    return _misuse_of_a_group(parsed) or ConfigError(message)


def _advice_on_parsing(override: str, overrides: Sequence[str]) -> str:
    """Say why an override can't be read: mostly it is a parenthesis that the shell cut."""
    if override.count("(") <= override.count(")"):
        return "can't be read as key=value"
    begin = overrides.index(override)
    for end in range(begin + 1, len(overrides) + 1):
        whole = " ".join(overrides[begin:end])
        if whole.count("(") == whole.count(")"):
            return f"parentheses need quotes; type '{whole}'"
    return "its parenthesis isn't closed; type it in quotes, as in 'seed=range(22)'"


def _advice_on_hydra(key: str) -> str:
    """Name the launcher's setting that is spelled most like a key that there isn't."""
    group, _, name = key.rpartition(".")
    near = difflib.get_close_matches(name, allowed(LauncherConfig), n=1)
    return f"; did you mean {group}.{near[0]}?" if near and group == "hydra.launcher" else ""


def _misuse_of_a_group(overrides: Sequence[Override]) -> ConfigError | None:
    """Return the error of ``env=null``, or of a key of a logger that isn't chosen."""
    loggers = " ".join(str(each.input_line) for each in overrides if each.key_or_group == "logger")
    for override in overrides:
        key, line = override.key_or_group, override.input_line
        is_name = isinstance(override.value(), str | list)
        if override.value_type is ValueType.ELEMENT and choices_of(key) and not is_name:
            return OutOfRange(key, override.get_value_string(), " or ".join(choices_of(key)))
        group, _, below = key.partition(".")
        name = below.partition(".")[0]
        if group == "logger" and name and name not in loggers:
            return ConfigError(f"{line}: {name} isn't chosen; 'logger=[csv,{name}]' does that")
    return None


def key_of(override: str) -> str:
    """Return the key that an override, ``lam=0.2`` or ``+lam=0.2``, is about."""
    return override.lstrip("+~").partition("=")[0]


@contextmanager
def _hydra() -> Iterator[None]:
    """Hydra on our ``conf/``; its global state is handed back as it was found."""
    hydra, base = GlobalHydra.instance().hydra, version.getbase()
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(
            str(config_directory()),
            job_name=JobRuntime.instance().get("name"),
            version_base=VERSION_BASE,
        ):
            yield
    finally:
        GlobalHydra.instance().hydra = hydra
        version.VersionBase.instance().version_base = base
