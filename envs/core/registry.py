"""What a kind in the configuration stands for: one of ours, or a user's own class."""

import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, TypeVar

from envs.core.parameters import ConfigError, Parameters

Entry = TypeVar("Entry")

KIND = r"\w+|[\w.]+:\w+", "a name, or module:Class"
"""The pattern of a kind, and the same in words."""


def is_own(kind: object) -> bool:
    """Return whether a kind names a class of a user's own, as ``my_package.my_module:MyWorld``."""
    return isinstance(kind, str) and ":" in kind


def kinds_in_words(known: Iterable[str]) -> str:
    """Return the kinds that there are, in words that complete "must be"."""
    return f"{', '.join(known)} or, of your own, module:Class"


def own_class(kind: str) -> type[Any]:
    """Import the class that a kind names.

    Modules are looked for where Python looks, and in the current directory.

    Args:
        kind: ``module:Class``.

    Raises:
        ConfigError: there is no such module or class, or its attribute ``schema`` is not a
            dataclass of :class:`envs.core.parameters.Parameters`.
    """
    module, _, name = kind.partition(":")
    if "" not in sys.path:  # as ``python -m`` has it, and a console script has not
        sys.path.insert(0, "")
    try:
        found = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"kind={kind}: {error}") from error
    schema = getattr(found, "schema", None)
    if not (isinstance(schema, type) and issubclass(schema, Parameters)):
        raise ConfigError(f"kind={kind}: its attribute schema must be a dataclass of Parameters")
    own: type[Any] = found
    return own


def schema_of(kind: str, known: Mapping[str, type[Parameters]]) -> type[Parameters]:
    """Return the schema of a kind: its keys with their ranges.

    Args:
        kind: a name in ``known``, or ``module:Class``.
        known: the schemas of ours.

    Raises:
        ConfigError: see :func:`own_class`.
    """
    if is_own(kind):
        schema: type[Parameters] = own_class(kind).schema
        return schema
    return known[kind]


def class_of(kind: str, known: Mapping[str, type[Entry]]) -> type[Entry]:
    """Return the class of a kind.

    Args:
        kind: a name in ``known``, or ``module:Class``.
        known: the classes of ours.

    Raises:
        ConfigError: see :func:`own_class`.
    """
    return own_class(kind) if is_own(kind) else known[kind]
