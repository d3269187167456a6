"""Find the schema and the class of a kind: a name of ours, or a user's own ``module:Class``."""

import inspect
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, TypeVar, cast

from envs.core.parameters import ConfigError, Parameters

Entry = TypeVar("Entry")

KIND = r"\w+|[\w.]+:\w+", "a name, or module:Class"
"""The pattern of a kind, and its description in words."""


def is_own(kind: object) -> bool:
    """Return whether a kind names a class of a user's own, as ``my_package.my_module:MyWorld``."""
    return isinstance(kind, str) and ":" in kind


def kinds_in_words(known: Iterable[str]) -> str:
    """Return the known kinds, in words that complete "must be"."""
    return f"{', '.join(known)} or, of your own, module:Class"


def own_class(group: str, kind: str) -> type[Any]:
    """Import the class that a kind names.

    Python's own path is searched first, then the current directory.

    Args:
        group: of the configuration, ``env`` or ``value``.
        kind: ``module:Class``.

    Raises:
        ConfigError: there is no such module or class, its attribute ``schema`` isn't a dataclass of
            :class:`envs.core.parameters.Parameters`, or either lacks an abstract method.
    """
    module, _, name = kind.partition(":")
    if "" not in sys.path:  # a console script has no current directory
        sys.path.append("")
    try:
        found = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"{group}.kind={kind}: {error}") from error
    schema = getattr(found, "schema", None)
    if not (isinstance(schema, type) and issubclass(schema, Parameters)):
        raise ConfigError(
            f"{group}.kind={kind}: its attribute schema must be a dataclass of Parameters"
        )
    for each in (found, schema):
        if missing := sorted(getattr(each, "__abstractmethods__", ())):
            line = f"{each.__name__} must have {' and '.join(missing)}"
            raise ConfigError(f"{group}.kind={kind}: {line}")
    own: type[Any] = found
    return own


def source_of(group: str, kind: str) -> str:
    """Return the text of the module that has the class of a user's own kind.

    Raises:
        ConfigError: see :func:`own_class`.
    """
    return inspect.getsource(sys.modules[own_class(group, kind).__module__])


def schema_of(group: str, kind: str, known: Mapping[str, type[Parameters]]) -> type[Parameters]:
    """Return the schema of a kind: its keys with their ranges.

    Args:
        group: of the configuration.
        kind: a name in ``known``, or ``module:Class``.
        known: our schemas by their kinds.

    Raises:
        ConfigError: see :func:`own_class`.
    """
    if is_own(kind):
        schema: type[Parameters] = own_class(group, kind).schema
        return schema
    return known[kind]


def class_of(group: str, kind: str, known: Mapping[str, type[Entry]], base: type) -> type[Entry]:
    """Return the class of a kind.

    Args:
        group: of the configuration.
        kind: a name in ``known``, or ``module:Class``.
        known: our classes by their kinds.
        base: the base that every class must have.

    Raises:
        ConfigError: see :func:`own_class`; or the class doesn't have that base.
    """
    if not is_own(kind):
        return known[kind]
    found: type[Any] = own_class(group, kind)
    if not issubclass(found, base):
        raise ConfigError(f"{group}.kind={kind}: must be a subclass of {base.__name__}")
    return cast(type[Entry], found)
