"""From overrides such as ``lam=0.2`` to a valid `Config`, and what to say when there is none."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from hydra import compose, initialize_config_dir, version
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.utils import JobRuntime
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf.errors import OmegaConfBaseException

from envs.ranges import allowed
from fnnq_torchrl.config import Config, ConfigError, OutOfRange, refusal, to_config

VERSION_BASE = "1.3"  # of Hydra, whose defaults change with it

# conf/config.yaml begins with this schema: Hydra then refuses unknown keys and wrong types.
ConfigStore.instance().store(name="schema", node=Config)


def config_directory() -> Path:
    """``fnnq_torchrl/conf``, where the wheel puts it, or else the checkout's top-level ``conf``."""
    package = Path(__file__).resolve().parent
    installed = package / "conf"
    return installed if installed.is_dir() else package.parent / "conf"


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


def explain(
    error: HydraException | OmegaConfBaseException, overrides: Sequence[str]
) -> ConfigError:
    """One line for an error on which Hydra spends several, without saying what is allowed.

    Args:
        error: what composing a configuration raised.
        overrides: the arguments it was composed with.
    """
    cause = error.__cause__ if isinstance(error.__cause__, OmegaConfBaseException) else error
    message = " ".join(str(error).split()) or str(cause).splitlines()[0]
    if isinstance(cause, OmegaConfBaseException):
        key = cause.full_key or "hydra"
        of_hydra = key.partition(".")[0] == "hydra"
        return ConfigError(message) if of_hydra else refusal(cause, _given(key, overrides))
    if isinstance(error, MissingConfigException) and error.missing_cfg_file and error.options:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        return OutOfRange(group, choice, " or ".join(error.options))
    if isinstance(error, OverrideParseException):
        return ConfigError(f"{error.override}: can't be read as key=value")
    for override in overrides:
        if "--multirun" in message and f"'{override}'" in message:
            key = override.partition("=")[0]
            range_ = allowed(Config).get(key, "one value")
            return ConfigError(
                f"{override}: several values need -m, a job for each; {key} must be {range_}"
            )
    return ConfigError(message)


def _given(key: str, overrides: Sequence[str]) -> str | None:
    """What the user wrote for a key."""
    for override in overrides:
        name, _, value = override.lstrip("+~").partition("=")
        if name == key:
            return value
    return None


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
