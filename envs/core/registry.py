"""The look-up of a kind's schema and class. A kind is a built-in name or ``module:Class``."""

import inspect
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, TypeVar, cast

from envs.core.parameters import ConfigError, Parameters

Entry = TypeVar("Entry")

KIND = r"\w+|(\w+:)?[\w.]+:\w+", "a name, or module:Class"
"""The regular expression that a kind matches, and its description in words.

A kind with two colons is a name and the class of another library that it adapts, as in
``torchrl:torchrl.envs:PendulumEnv``.
"""


def is_own(kind: object) -> bool:
    """Return whether a kind names a user's class, as in ``my_package.my_module:MyWorld``."""
    return isinstance(kind, str) and ":" in kind


def names_code(key: str, value: object) -> bool:
    """Return whether a key's value names code that would be imported, or is passed to such code.

    It is a user's class, an environment of Gymnasium with its module (``module:Name-v0``), or an
    argument of another library's class.

    Args:
        key: the key with its groups.
        value: its value.
    """
    named = is_own(value) and (key.endswith(".kind") or key == "env.id")
    return named or key.startswith("env.arguments.")


def kinds_in_words(known: Iterable[str]) -> str:
    """Return the allowed kinds in words that can follow "must be"."""
    return f"{', '.join(known)} or your own module:Class"


def _adapter_of(kind: str) -> str | None:
    """Return the name of the adapter in ``adapter:module:Class``, None if there is none."""
    adapter, _, rest = kind.partition(":")
    return adapter if ":" in rest else None


def imported_class(group: str, kind: str) -> Any:
    """Import what a kind names in a module of the user's.

    The module is searched for on Python's path, and then in the current directory.

    Args:
        group: the configuration's group, ``env`` or ``value``.
        kind: ``module:Class`` or ``adapter:module:Class``.

    Raises:
        ConfigError: if there is no such module or class.
    """
    *_, module, name = kind.split(":")
    if "" not in sys.path:  # the current directory, missing in a console script
        sys.path.append("")
    try:
        return getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"{group}.kind={kind}: {error}") from error


def own_class(group: str, kind: str) -> type[Any]:
    """Import and check the user's class that a kind names.

    Args:
        group: the configuration's group, ``env`` or ``value``.
        kind: ``module:Class``.

    Raises:
        ConfigError: if there is no such module or class, its attribute ``schema`` doesn't inherit
            from :class:`envs.core.parameters.Parameters`, or the class or its schema leaves an
            abstract method undefined.
    """
    found = imported_class(group, kind)
    schema = getattr(found, "schema", None)
    if not (isinstance(schema, type) and issubclass(schema, Parameters)):
        raise ConfigError(
            f"{group}.kind={kind}: its attribute schema must be a dataclass derived from Parameters"
        )
    for each in (found, schema):
        if missing := sorted(getattr(each, "__abstractmethods__", ())):
            line = f"{each.__name__} must have {' and '.join(missing)}"
            raise ConfigError(f"{group}.kind={kind}: {line}")
    own: type[Any] = found
    return own


def source_of(group: str, kind: str) -> str:
    """Return the source code of the module that defines the class that a kind names.

    Raises:
        ConfigError: see :func:`imported_class`.
    """
    return inspect.getsource(sys.modules[imported_class(group, kind).__module__])


def _known_adapter(group: str, kind: str, known: Mapping[str, Entry]) -> Entry | None:
    """Return the entry of a kind's adapter, None if the kind has no adapter.

    Raises:
        ConfigError: if there is no such adapter.
    """
    adapter = _adapter_of(kind)
    if adapter is not None and adapter not in known:
        raise ConfigError(f"{group}.kind={kind}: {adapter} adapts no other library's classes")
    return None if adapter is None else known[adapter]


def schema_of(group: str, kind: str, known: Mapping[str, type[Parameters]]) -> type[Parameters]:
    """Return the schema of a kind: its keys with their ranges.

    Args:
        group: the configuration's group, ``env`` or ``value``.
        kind: a name in ``known``, ``module:Class``, or a name in ``known`` before them.
        known: the built-in schemas by kind.

    Raises:
        ConfigError: see :func:`own_class`; or if there is no such adapter.
    """
    if (adapter := _known_adapter(group, kind, known)) is not None:
        return adapter
    if is_own(kind):
        schema: type[Parameters] = own_class(group, kind).schema
        return schema
    return known[kind]


def class_of(group: str, kind: str, known: Mapping[str, type[Entry]], base: type) -> type[Entry]:
    """Return the class of a kind.

    Args:
        group: the configuration's group, ``env`` or ``value``.
        kind: a name in ``known``, ``module:Class``, or a name in ``known`` before them.
        known: the built-in classes by kind.
        base: the class from which a user's class must inherit.

    Raises:
        ConfigError: see :func:`own_class`; or if the class doesn't inherit from ``base``.
    """
    if (adapter := _known_adapter(group, kind, known)) is not None:
        return adapter
    if not is_own(kind):
        return known[kind]
    found: type[Any] = own_class(group, kind)
    if not issubclass(found, base):
        raise ConfigError(f"{group}.kind={kind}: must be a subclass of {base.__name__}")
    return cast(type[Entry], found)
