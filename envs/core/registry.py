"""The look-up of a kind's schema and class. A kind is a built-in name or ``module:Class``."""

import difflib
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


def kinds_in_words(known: Iterable[str]) -> str:
    """Return the allowed kinds in words that can follow "must be"."""
    return f"{', '.join(known)} or your own module:Class"


def _adapter_of(kind: str) -> str | None:
    """Return the name of the adapter in ``adapter:module:Class``, None if there is none."""
    adapter, _, rest = kind.partition(":")
    return adapter if ":" in rest else None


def imported_class(key: str, kind: str) -> Any:
    """Import what a kind names in a module of the user's.

    The module is searched for on Python's path, and then in the current directory.

    Args:
        key: the kind's key in the configuration, such as ``env.kind``.
        kind: ``module:Class`` or ``adapter:module:Class``.

    Raises:
        ConfigError: if there is no such module or class.
    """
    *_, module, name = kind.split(":")
    if "" not in sys.path:  # the current directory, missing in a console script
        sys.path.append("")
    try:
        found = import_module(module)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"{key}={kind}: {error}") from error
    if not hasattr(found, name):
        near = difflib.get_close_matches(name, vars(found), n=1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise ConfigError(f"{key}={kind}: module {module!r} has no attribute {name!r}{meant}")
    return getattr(found, name)


def own_class(key: str, kind: str) -> type[Any]:
    """Import the user's class that a kind names.

    Args:
        key: the kind's key in the configuration.
        kind: ``module:Class``.

    Raises:
        ConfigError: if there is no such module or class, or the class leaves an abstract method
            undefined.
    """
    found: type[Any] = imported_class(key, kind)
    _refuse_abstract(found, key, kind)
    return found


def source_of(key: str, kind: str) -> str:
    """Return the source code of the module that defines the class that a kind names.

    Raises:
        ConfigError: see :func:`imported_class`.
    """
    return inspect.getsource(sys.modules[imported_class(key, kind).__module__])


def _refuse_abstract(found: type, key: str, kind: str) -> None:
    if missing := sorted(getattr(found, "__abstractmethods__", ())):
        line = f"{found.__name__} must have {' and '.join(missing)}"
        raise ConfigError(f"{key}={kind}: {line}")


def _known_adapter(key: str, kind: str, known: Mapping[str, Entry]) -> Entry | None:
    """Return the entry of a kind's adapter, None if the kind has no adapter.

    Raises:
        ConfigError: if there is no such adapter.
    """
    adapter = _adapter_of(kind)
    if adapter is not None and adapter not in known:
        raise ConfigError(f"{key}={kind}: {adapter} adapts no other library's classes")
    return None if adapter is None else known[adapter]


def schema_of(key: str, kind: str, known: Mapping[str, type[Parameters]]) -> type[Parameters]:
    """Return the schema of a kind: its keys with their ranges.

    Args:
        key: the kind's key in the configuration, ``env.kind`` or ``value.kind``.
        kind: a name in ``known``, ``module:Class``, or a name in ``known`` before them.
        known: the built-in schemas by kind.

    Raises:
        ConfigError: see :func:`own_class`; if there is no such adapter; or if the attribute
            ``schema`` of the user's class doesn't inherit from
            :class:`envs.core.parameters.Parameters`, or leaves an abstract method undefined.
    """
    if (adapter := _known_adapter(key, kind, known)) is not None:
        return adapter
    if not is_own(kind):
        return known[kind]
    schema: Any = getattr(own_class(key, kind), "schema", None)
    if not (isinstance(schema, type) and issubclass(schema, Parameters)):
        wanted = "its attribute schema must be a dataclass derived from Parameters"
        raise ConfigError(f"{key}={kind}: {wanted}")
    _refuse_abstract(schema, key, kind)
    return schema


def class_of(key: str, kind: str, known: Mapping[str, type[Entry]], base: type) -> type[Entry]:
    """Return the class of a kind.

    Args:
        key: the kind's key in the configuration.
        kind: a name in ``known``, ``module:Class``, or a name in ``known`` before them.
        known: the built-in classes by kind.
        base: the class from which a user's class must inherit.

    Raises:
        ConfigError: see :func:`own_class`; or if the class doesn't inherit from ``base``.
    """
    if (adapter := _known_adapter(key, kind, known)) is not None:
        return adapter
    if not is_own(kind):
        return known[kind]
    found = own_class(key, kind)
    if not (isinstance(found, type) and issubclass(found, base)):
        raise ConfigError(f"{key}={kind}: must be a subclass of {base.__name__}")
    return cast(type[Entry], found)
