"""The check of composed values: a valid configuration, or an error of one line."""

import difflib
import re
from collections.abc import Mapping
from functools import cache
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

from envs.core.parameters import ConfigError, OutOfRange, Parameters, allowed
from envs.core.registry import is_own, kinds_in_words, schema_of
from envs.schemas import SCHEMAS as WORLDS
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.config.values import SCHEMAS as VALUES

_OF_KINDS: dict[str, Mapping[str, type[Parameters]]] = {"env": WORLDS, "value": VALUES}
"""The groups whose keys depend on their kind, with our schemas by kind."""

Kinds = Mapping[str, str]
"""The chosen kinds by their groups, as far as they are known."""


def flat(settings: Mapping[str, Any], group: str = "") -> dict[str, Any]:
    """Return nested settings by keys with groups, as in ``env.speed_mps``; lists are values."""
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
        value: the value given, if it is known.
        kinds: the chosen kinds, as far as they are known.
    """

    def __init__(self, key: str, value: object, kinds: Kinds) -> None:
        super().__init__(key, value, kinds)
        self.key, self.value, self.kinds = key, value, kinds

    def __str__(self) -> str:
        given = self.key if self.value is None else f"{self.key}={self.value}"
        return f"{given}: {_advice(self.key, self.kinds)}"


def to_config(node: DictConfig | dict[str, Any], *, own: bool = False) -> Config:
    """Return the valid configuration of composed values.

    Args:
        node: a mapping with all the keys, typed or plain, as a saved ``.hydra/config.yaml``.
        own: whether kinds may be the user's own classes, which are then imported. Not for values
            from elsewhere.

    Raises:
        ConfigError: a key is missing or unknown, or its value isn't allowed.
    """
    # As a plain mapping, so that the schema refuses the unknown keys of `+key=value`.
    plain = cast(dict[str, Any], node if isinstance(node, dict) else OmegaConf.to_container(node))
    if not own:
        for key, value in flat(plain).items():
            if re.search(r"\$\{.*:", str(value)):  # calls a function
                raise ConfigError(f"{key}={value}: must be a plain value")
    kinds = {group: kind for group in _OF_KINDS if (kind := _kind(plain, group, own)) is not None}
    try:
        return cast(Config, OmegaConf.to_object(OmegaConf.merge(_schema(**kinds), plain)))
    except OmegaConfBaseException as error:
        given = OmegaConf.create(plain)
        value = OmegaConf.select(given, error.full_key or "", throw_on_resolution_failure=False)
        raise refusal(error, value, kinds) from error


@cache
def _schema(**kinds: str) -> DictConfig:
    """Return the schema of configurations of these kinds; callers mustn't change it."""
    schema = OmegaConf.structured(Config)
    for group, kind in kinds.items():
        schema[group] = OmegaConf.structured(schema_of(group, kind, _OF_KINDS[group]))
    return schema


def _kind(plain: dict[str, Any], group: str, own: bool) -> str | None:
    """Return the kind of a group in composed values, or None if they have none.

    Raises:
        OutOfRange: there is no such kind, or it isn't allowed.
    """
    values, known = plain.get(group, "???"), _OF_KINDS[group]
    if values == "???":
        return None
    if not isinstance(values, dict):
        raise OutOfRange(group, values, allowed(Config)[group])
    kind = values.get("kind", "???")
    if is_own(kind) and not own:
        raise OutOfRange(f"{group}.kind", kind, f"{' or '.join(known)} in values from elsewhere")
    if not isinstance(kind, str) or (kind not in known and not is_own(kind)):
        raise OutOfRange(f"{group}.kind", kind, kinds_in_words(known))
    return kind


def refusal(
    error: OmegaConfBaseException, given: object, kinds: Kinds | None = None
) -> ConfigError:
    """Return an error of one line that says what is allowed, for one of OmegaConf's.

    Args:
        error: OmegaConf's, which has several lines and doesn't say what is allowed.
        given: the user's value of the key, since not every error has it.
        kinds: the chosen kinds, as far as they are known.
    """
    key, ranges = error.full_key or "", ranges_of(kinds)
    if isinstance(error, ConfigKeyError | ConfigAttributeError):
        return UnknownKey(key, given, kinds or _kind_beside(error))
    # The range of an entry is that of its list or mapping.
    words = ranges.get(key) or ranges.get(key.partition("[")[0]) or ranges.get(_group(key))
    if below := [_name(each) for each in ranges if each.startswith(f"{key}.")]:
        words = words or f"a mapping of {', '.join(below)}"
    if isinstance(error, MissingMandatoryValue) and words:
        return OutOfRange(key, "???", words)
    if isinstance(error, ValidationError | ConfigTypeError) and words:
        value = getattr(error, "value", None)
        return OutOfRange(key, given if value is None else value, words)
    return ConfigError(f"{key}: {str(error).splitlines()[0]}")


def _kind_beside(error: OmegaConfBaseException) -> Kinds:
    """Return the kind of the group in which a key is unknown, if it is one of ours."""
    group = _group(error.full_key or "")
    if group not in _OF_KINDS or not isinstance(error.parent_node, DictConfig):
        return {}
    kind = OmegaConf.select(error.parent_node, "kind")
    return {group: kind} if kind in _OF_KINDS[group] else {}


def ranges_of(kinds: Kinds | None = None) -> dict[str, str]:
    """Return the range of each key, in words that complete "must be".

    Args:
        kinds: the chosen kinds; a group without one has the keys of all its kinds.
    """
    ranges = allowed(Config)
    for group, known in _OF_KINDS.items():
        kind = (kinds or {}).get(group)
        for schema in known.values() if kind is None else [schema_of(group, kind, known)]:
            ranges |= allowed(schema, f"{group}.")
        ranges[f"{group}.kind"] = kinds_in_words(known)
    return ranges


def _advice(unknown: str, kinds: Kinds) -> str:
    """Say who has such a key: another kind, another group, or this one in another spelling."""
    group, _, name = unknown.partition(".")
    schemas, missing = _OF_KINDS.get(group, {}), f"there is no {unknown}"
    if owners := [kind for kind in schemas if unknown in allowed(schemas[kind], f"{group}.")]:
        if kind := kinds.get(group):
            missing = f"{group}{'' if kind in schemas else '.kind'}={kind} has no {name}"
        return f"{missing}; it belongs to {group}={' or '.join(owners)}"
    keys = [*ranges_of(kinds)]
    keys += dict.fromkeys(_group(key) for key in keys if _group(key))
    beside = {_name(key): key for key in keys if _group(key) == _group(unknown)}
    same = [key for key in keys if _name(key) == _name(unknown)]
    near = difflib.get_close_matches(_name(unknown), beside, n=1)
    if meant := same or [beside[name] for name in near]:
        return f"{missing}; did you mean {' or '.join(meant)}?"
    return f"{missing}; there is {', '.join(beside.values()) or _group(unknown)}"


def _group(key: str) -> str:
    return key.rpartition(".")[0]


def _name(key: str) -> str:
    return key.rpartition(".")[2]
