"""The configuration of a job: a typed and range-checked schema without values.

``conf/`` holds every value, with its unit and its source. Nothing here imports torch or Hydra, so
that a mistake is told before anything heavy is loaded.
"""

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import (
    ConfigAttributeError,
    ConfigKeyError,
    ConfigTypeError,
    MissingMandatoryValue,
    OmegaConfBaseException,
    ValidationError,
)

from envs.core.parameters import (
    ConfigError,
    OutOfRange,
    Parameters,
    allowed,
    check,
    flag,
    matching,
    number,
    one_of,
    pairs,
    parameters,
    whole,
)
from envs.core.registry import is_own, kinds_in_words, schema_of
from envs.robot.schemas import World
from fnnq_torchrl.config.loggers import LoggerConfig
from fnnq_torchrl.config.values import SCHEMAS
from fnnq_torchrl.equations.names import EXPLORATIONS, STEP_SIZES, TRACES, VARIANTS

__all__ = [
    "PER_RUN",
    "ActionConfig",
    "CheckpointConfig",
    "Config",
    "ConfigError",
    "EvaluationConfig",
    "MachineConfig",
    "OutOfRange",
    "UnknownKey",
    "flat",
    "ranges_of",
    "refusal",
    "run_columns",
    "to_config",
]

PER_RUN = (
    "seed",
    "lam",
    "alpha",
    "alpha_decay",
    "kappa",
    "gamma",
    "epsilon",
    "temperature",
    "noise_std",
)
"""The keys whose values may differ from run to run within one batch; all others are shared."""


@dataclass
class ActionConfig(Parameters):
    """The actions among which the best is sought."""

    candidates: int = whole(2)


@dataclass
class MachineConfig(Parameters):
    """Where to compute, and how precisely."""

    device: str = matching(r"cpu|cuda(:[0-9]+)?", "cpu, cuda or cuda:N")
    dtype: str = one_of("float32", "float64")


@dataclass
class EvaluationConfig(Parameters):
    """When the runs are tested, and on which starts of the ball [angle, speed]."""

    every: int = whole(1)
    situations: list[Any] = pairs("angle", "speed")


@dataclass
class CheckpointConfig(Parameters):
    """When a training that isn't finished is saved, and what is kept of one that is."""

    every_s: float = number(above=0)
    snapshots: bool = flag()


@dataclass(kw_only=True)
class Config(Parameters):
    """One job: a batch of runs that learn side by side. Checked when it is made."""

    lam: float = number(0, 1)
    seed: int = whole(0)
    num_seeds: int = whole(1)
    step_size: str = one_of(*STEP_SIZES)
    alpha: float = number(0)
    alpha_decay: float = number(above=0, high=1)
    kappa: float = number(above=1)
    gamma: float = number(0, 1)
    exploration: str = one_of(*EXPLORATIONS)
    epsilon: float = number(0, 1)
    temperature: float = number(above=0)
    noise_std: float = number(0)
    variant: str = one_of(*VARIANTS)
    trace: str = one_of(*TRACES)
    window: int = whole(1)
    diverged_beyond: float = number(above=1)
    engine: str = one_of("auto", "eager", "compiled")
    situations: int = whole(1)
    resume: str = one_of("auto", "never")

    env: World
    value: Any = parameters(SCHEMAS)
    action: ActionConfig
    evaluation: EvaluationConfig
    machine: MachineConfig
    checkpoint: CheckpointConfig
    logger: LoggerConfig = field(default_factory=LoggerConfig)  # of none but the result files

    def __post_init__(self) -> None:
        check(self)

    def contradictions(self) -> Iterator[OutOfRange]:
        """A constant that decays; learning beyond the last evaluation; seeds beyond 63 bits."""
        if self.step_size == "constant" and self.alpha_decay != 1:
            yield OutOfRange("alpha_decay", self.alpha_decay, "1 where step_size=constant")
        every = self.evaluation.every
        if self.situations % every:
            multiple = f"a whole multiple of evaluation.every={every}"
            yield OutOfRange("situations", self.situations, multiple)
        if self.seed + self.num_seeds > 2**63:
            highest = f"at most {2**63 - self.num_seeds}, for the last seed to fit 63 bits"
            yield OutOfRange("seed", self.seed, highest)


def run_columns(config: Config) -> dict[str, list[float]]:
    """The columns of the values that may differ from run to run.

    Returns:
        By each key of `PER_RUN`, a list of length ``num_seeds``: the seeds ``seed … seed +
        num_seeds − 1`` as integers, and each other value repeated.
    """
    runs = range(config.num_seeds)
    columns: dict[str, list[float]] = {key: [getattr(config, key) for _ in runs] for key in PER_RUN}
    return columns | {"seed": [config.seed + run for run in runs]}


def flat(settings: Mapping[str, Any], group: str = "") -> dict[str, Any]:
    """Nested settings by their keys with groups, as in ``env.speed_mps``; lists are values."""
    keys: dict[str, Any] = {}
    for key, value in settings.items():
        if isinstance(value, Mapping):
            keys |= flat(value, f"{group}{key}.")
        else:
            keys[f"{group}{key}"] = value
    return keys


class UnknownKey(ConfigError):
    """A key that the configuration doesn't have.

    Args:
        key: the key with its groups.
        value: what was given, if that is known.
        kind: which value function it is, if that is known.
    """

    def __init__(self, key: str, value: object, kind: str | None = None) -> None:
        super().__init__(key, value, kind)
        self.key, self.value, self.kind = key, value, kind

    def __str__(self) -> str:
        given = self.key if self.value is None else f"{self.key}={self.value}"
        return f"{given}: there is no {self.key}; {_advice(self.key, self.kind)}"


def to_config(node: DictConfig) -> Config:
    """The valid `Config` of composed values.

    Args:
        node: a mapping with all the keys, typed or plain: a saved ``.hydra/config.yaml`` will do.

    Raises:
        ConfigError: a key is missing or unknown, or its value isn't allowed.
    """
    # As a plain mapping, so that the schema refuses what Hydra lets in by `+key=value`.
    plain = cast(dict[str, Any], OmegaConf.to_container(node))
    kind = _kind(plain)
    schema = OmegaConf.structured(Config)
    if kind is not None:
        schema.value = OmegaConf.structured(schema_of(kind, SCHEMAS))
    try:
        return cast(Config, OmegaConf.to_object(OmegaConf.merge(schema, plain)))
    except OmegaConfBaseException as error:
        value = OmegaConf.select(node, error.full_key or "", throw_on_resolution_failure=False)
        raise refusal(error, value, kind) from error


def _kind(plain: dict[str, Any]) -> str | None:
    """Which value function composed values are of; none if they leave it out.

    Raises:
        OutOfRange: there is no such value function.
    """
    value = plain.get("value", "???")
    if value == "???":
        return None
    if not isinstance(value, dict):
        raise OutOfRange("value", value, allowed(Config)["value"])
    kind = value.get("kind", "???")
    if kind not in SCHEMAS and not is_own(kind):
        raise OutOfRange("value.kind", kind, kinds_in_words(SCHEMAS))
    return cast(str, kind)


def refusal(error: OmegaConfBaseException, given: object, kind: str | None = None) -> ConfigError:
    """What OmegaConf refuses, in one line that says what is allowed.

    Args:
        error: OmegaConf's own, which takes several lines and doesn't say.
        given: what the user gave for the key, for the errors that don't hold it.
        kind: which value function it is, if that is known.
    """
    key, ranges = error.full_key or "", ranges_of(kind)
    if isinstance(error, ConfigKeyError | ConfigAttributeError):
        return UnknownKey(key, given, kind)
    # What stands in a mapping has no range of its own but the mapping's.
    words = ranges.get(key) or ranges.get(_group(key))
    if below := [_name(each) for each in ranges if each.startswith(f"{key}.")]:
        words = words or f"a mapping of {', '.join(below)}"
    if isinstance(error, MissingMandatoryValue) and words:
        return OutOfRange(key, "???", words)
    if isinstance(error, ValidationError | ConfigTypeError) and words:
        value = getattr(error, "value", None)
        return OutOfRange(key, given if value is None else value, words)
    return ConfigError(f"{key}: {str(error).splitlines()[0]}")


def ranges_of(kind: str | None = None) -> dict[str, str]:
    """What each key may hold, in words that complete "must be".

    Args:
        kind: of value function; the keys of all kinds, if not given.
    """
    ranges = allowed(Config)
    for schema in SCHEMAS.values() if kind is None else [schema_of(kind, SCHEMAS)]:
        ranges |= allowed(schema, "value.")
    return ranges | {"value.kind": kinds_in_words(SCHEMAS)}


def _advice(unknown: str, kind: str | None) -> str:
    """Points to the key of the same name elsewhere, or to the nearest spelling beside it."""
    keys = [*ranges_of(kind)]
    keys += dict.fromkeys(_group(key) for key in keys if _group(key))
    beside = {_name(key): key for key in keys if _group(key) == _group(unknown)}
    same = [key for key in keys if _name(key) == _name(unknown)]
    near = difflib.get_close_matches(_name(unknown), beside, n=1)
    if meant := same or [beside[name] for name in near]:
        return f"did you mean {' or '.join(meant)}?"
    return f"there is {', '.join(beside.values()) or _group(unknown)}"


def _group(key: str) -> str:
    return key.rpartition(".")[0]


def _name(key: str) -> str:
    return key.rpartition(".")[2]
