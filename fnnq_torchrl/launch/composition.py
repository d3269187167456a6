"""From overrides such as ``lam=0.2`` to a valid `Config`, and what to say when there is none."""

import difflib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from traceback import walk_tb

from hydra import compose, initialize_config_dir, version
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.utils import JobRuntime
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf.errors import OmegaConfBaseException

from envs.core.parameters import allowed
from fnnq_torchrl.config.choices import choices_of, config_directory
from fnnq_torchrl.config.launcher import LauncherConfig
from fnnq_torchrl.config.schema import Config, ConfigError, OutOfRange, refusal, to_config

VERSION_BASE = "1.3"  # of Hydra, whose defaults change with it

# conf/config.yaml begins with this schema: Hydra then refuses unknown keys and wrong types.
ConfigStore.instance().store(name="schema", node=Config)


def load_config(*overrides: str) -> Config:
    """The configuration that a command would train with: ``load_config("lam=0.8", "seed=3")``.

    Works anywhere, inside another Hydra application too.

    Args:
        *overrides: as on the command line, without sweeps.

    Raises:
        ConfigError: a key is unknown or its value isn't allowed.
    """
    try:
        with _hydra():
            return to_config(compose("config", list(overrides)))
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error, overrides) from error
    except Exception as error:
        if not is_of_hydra(error):
            raise
        raise explain(error, overrides) from error


def is_of_hydra(error: Exception) -> bool:
    """Whether it is Hydra that can't do what it was asked for, and no job has begun to fail."""
    modules = [frame.f_globals.get("__name__", "") for frame, _ in walk_tb(error.__traceback__)]
    known = [name.partition(".")[0] for name in modules]
    known = [name for name in known if name in ("hydra", "omegaconf", "fnnq_torchrl", "envs")]
    return known[-1:] in (["hydra"], ["omegaconf"]) and "fnnq_torchrl.training.job" not in modules


def explain(error: Exception, overrides: Sequence[str]) -> ConfigError:
    """One line for an error on which Hydra spends several, without saying what is allowed.

    Args:
        error: what composing a configuration raised: mostly Hydra's or OmegaConf's own, but Hydra
            stumbles over some input by errors of other kinds.
        overrides: the arguments it was composed with.
    """
    if "group override must be" in str(error):
        return _no_choice(overrides)
    if isinstance(error, AssertionError) and (unchosen := _unchosen(overrides)):
        return unchosen
    cause = error.__cause__ if isinstance(error.__cause__, OmegaConfBaseException) else error
    message = " ".join(str(error).split()) or f"Hydra can't do that: {_origin(error)}"
    if isinstance(cause, OmegaConfBaseException):
        key = cause.full_key or "hydra"
        if key.partition(".")[0] == "hydra":
            return ConfigError(message + _advice_on_hydra(key))
        return refusal(cause, _given(key, overrides))
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        # Of a choice that stands in a list Hydra doesn't say what else there is.
        if options := error.options or choices_of(group):
            return OutOfRange(group, choice, " or ".join(options))
    if isinstance(error, OverrideParseException):
        return ConfigError(f"{error.override}: {_advice_on_parsing(error.override, overrides)}")
    for override in overrides:
        if "--multirun" in message and f"'{override}'" in message:
            return SeveralValues(f"{override}: several values need -m, a job for each")
    return ConfigError(message)


def _origin(error: Exception) -> str:
    """Where it was raised, for an error without words."""
    *_, (frame, line) = walk_tb(error.__traceback__)
    return f"{type(error).__name__} in {frame.f_code.co_filename}, line {line}"


def _no_choice(overrides: Sequence[str]) -> ConfigError:
    """Of overrides such as ``env=null``, what the group may be."""
    wrong = []
    for override in overrides:
        group, _, value = override.partition("=")
        choices = choices_of(group)
        if group in allowed(Config) or "." in group or value in choices:
            continue
        if group and choices:
            return OutOfRange(group, value, " or ".join(choices))
        wrong.append(override)
    return ConfigError(f"{' '.join(wrong)}: must name one of the choices of a group")


def _unchosen(overrides: Sequence[str]) -> ConfigError | None:
    """Of settings, one of a logger that isn't chosen, on which OmegaConf fails an assertion."""
    chosen = " ".join(override for override in overrides if key_of(override) == "logger")
    for override in overrides:
        group, _, below = key_of(override).partition(".")
        name = below.partition(".")[0]
        if group == "logger" and name and name not in chosen:
            return ConfigError(f"{override}: {name} isn't chosen; 'logger=[csv,{name}]' does that")
    return None


class SeveralValues(ConfigError):
    """Several values for a key, and no ``-m``."""


def _advice_on_hydra(key: str) -> str:
    """Of the launcher's settings, the nearest in spelling to a key that there isn't."""
    group, _, name = key.rpartition(".")
    near = difflib.get_close_matches(name, allowed(LauncherConfig), n=1)
    return f"; did you mean {group}.{near[0]}?" if near and group == "hydra.launcher" else ""


def _advice_on_parsing(override: str, overrides: Sequence[str]) -> str:
    """Why something can't be read as an override, where it is a parenthesis that the shell cut."""
    for end in range(1, len(overrides) + 1):
        if override.count("(") <= override.count(")"):
            break
        for begin in range(end):
            whole = " ".join(overrides[begin:end])
            if overrides[begin] == override and whole.count("(") == whole.count(")"):
                return f"parentheses need quotes; type '{whole}'"
    else:
        return "its parenthesis isn't closed; type it in quotes, as in 'seed=range(22)'"
    return "can't be read as key=value"


def _given(key: str, overrides: Sequence[str]) -> str | None:
    """What the user wrote for a key."""
    for override in overrides:
        if key_of(override) == key:
            return override.partition("=")[2]
    return None


def key_of(override: str) -> str:
    """The key that an override, ``lam=0.2`` or ``+lam=0.2``, is about."""
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
