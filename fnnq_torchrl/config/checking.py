"""The check that composed values are a valid configuration; each error is one line."""

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
from envs.core.registry import is_own, kinds_in_words, own_class, schema_of
from envs.schemas import ADAPTERS
from envs.schemas import SCHEMAS as WORLDS
from fnnq_torchrl.config.own import LEARNER, names_code
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.config.values import SCHEMAS as VALUES

_OF_KINDS: dict[str, Mapping[str, type[Parameters]]] = {"env": WORLDS, "value": VALUES}
"""The groups whose keys depend on the key ``kind``, with the built-in schemas by kind."""

_SCHEMAS = _OF_KINDS | {"env": WORLDS | ADAPTERS}
"""As `_OF_KINDS`, with the schemas for the classes of other libraries."""

Kinds = Mapping[str, str]
"""The chosen kind of each group whose kind is known."""


def flat(settings: Mapping[str, Any], group: str = "") -> dict[str, Any]:
    """Return nested mappings as one, with keys like ``env.speed_mps``; lists are kept as values."""
    keys: dict[str, Any] = {}
    for key, value in settings.items():
        if isinstance(value, Mapping):
            keys |= flat(value, f"{group}{key}.")
        else:
            keys[f"{group}{key}"] = value
    return keys


class UnknownKey(ConfigError):
    """An error for a key that the configuration doesn't have, with advice in its message.

    Args:
        key: the key with its groups.
        value: the value given, or None if it isn't known.
        kinds: the chosen kind of each group whose kind is known.
    """

    def __init__(self, key: str, value: object, kinds: Kinds) -> None:
        super().__init__(key, value, kinds)
        self.key, self.value, self.kinds = key, value, kinds

    def __str__(self) -> str:
        given = self.key if self.value is None else f"{self.key}={self.value}"
        return f"{given}: {_advice(self.key, self.kinds)}"


def to_config(node: DictConfig | dict[str, Any], *, own: bool = False) -> Config:
    """Check composed values and return them as a configuration.

    Args:
        node: a mapping with all keys, such as a saved ``.hydra/config.yaml``.
        own: whether a kind may name a user's class, which is then imported. False for values from
            an untrusted source, which then can't call functions either. The classes of `LEARNER`
            aren't imported then: who reads results doesn't need them.

    Raises:
        ConfigError: if a key is missing or unknown, or its value isn't allowed.
    """
    # In a plain mapping, unknown keys added by `+key=value` are errors in the merge below.
    plain = cast(dict[str, Any], node if isinstance(node, dict) else OmegaConf.to_container(node))
    if not own:
        for key, value in flat(plain).items():
            if re.search(r"\$\{.*:", str(value)):  # an interpolation that calls a function
                raise ConfigError(f"{key}={value}: must be a plain value")
            if not key.endswith(".kind") and key not in LEARNER and names_code(key, value):
                raise ConfigError(f"{key}={value}: names code from outside fnnq_torchrl")
    kinds = {group: kind for group in _OF_KINDS if (kind := _kind(plain, group, own)) is not None}
    try:
        config = cast(Config, OmegaConf.to_object(OmegaConf.merge(_schema(**kinds), plain)))
    except OmegaConfBaseException as error:
        given = OmegaConf.create(plain)
        value = OmegaConf.select(given, error.full_key or "", throw_on_resolution_failure=False)
        raise refusal(error, value, kinds) from error
    if own:
        for key in LEARNER:
            if is_own(kind := getattr(config, key)):
                own_class(key, kind)  # refused now, if there is no such class
    return config


@cache
def _schema(**kinds: str) -> DictConfig:
    """Return the schema of a configuration with these kinds; callers must not modify it."""
    schema = OmegaConf.structured(Config)
    for group, kind in kinds.items():
        schema[group] = OmegaConf.structured(schema_of(f"{group}.kind", kind, _SCHEMAS[group]))
    return schema


def _kind(plain: dict[str, Any], group: str, own: bool) -> str | None:
    """Return the kind of a group in composed values, or None if the group is missing.

    Raises:
        OutOfRange: if there is no such kind, or it isn't allowed.
    """
    values, known = plain.get(group, "???"), _OF_KINDS[group]
    if values == "???":
        return None
    if not isinstance(values, dict):
        raise OutOfRange(group, values, allowed(Config)[group])
    kind = values.get("kind", "???")
    if is_own(kind) and not own:
        raise OutOfRange(f"{group}.kind", kind, f"{' or '.join(known)} in untrusted values")
    if not isinstance(kind, str) or (kind not in known and not is_own(kind)):
        raise OutOfRange(f"{group}.kind", kind, kinds_in_words(known))
    return kind


def refusal(
    error: OmegaConfBaseException, given: object, kinds: Kinds | None = None
) -> ConfigError:
    """Return a ConfigError with a one-line message for an error of OmegaConf.

    Args:
        error: OmegaConf's error, with several lines that don't say which values are allowed.
        given: the user's value of the key, which some of OmegaConf's errors lack.
        kinds: the chosen kind of each group whose kind is known.
    """
    key, ranges = error.full_key or "", ranges_of(kinds)
    if isinstance(error, ConfigKeyError | ConfigAttributeError):
        return UnknownKey(key, given, kinds or _kind_beside(error))
    # The entries of a list or mapping have the range that is declared for it.
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
    """Return the kind of the group in which a key is unknown, if the kind is built in."""
    group = _group(error.full_key or "")
    if group not in _OF_KINDS or not isinstance(error.parent_node, DictConfig):
        return {}
    kind = OmegaConf.select(error.parent_node, "kind")
    return {group: kind} if kind in _OF_KINDS[group] else {}


def ranges_of(kinds: Kinds | None = None) -> dict[str, str]:
    """Return the range of each key in words that can follow "must be".

    Args:
        kinds: the chosen kinds. For a group without a chosen kind, the keys of all kinds count.
    """
    ranges = allowed(Config)
    for group, known in _OF_KINDS.items():
        kind = (kinds or {}).get(group)
        chosen = kind and [schema_of(f"{group}.kind", kind, _SCHEMAS[group])]
        for schema in chosen or known.values():
            ranges |= allowed(schema, f"{group}.")
        ranges[f"{group}.kind"] = kinds_in_words(known)
    return ranges


def _advice(unknown: str, kinds: Kinds) -> str:
    """Return advice on an unknown key: the kind that has it, a similar key, or all keys."""
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
