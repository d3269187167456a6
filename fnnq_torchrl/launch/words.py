"""The words key=value of commands without Hydra, or one line on what is wrong with them."""

import difflib
from collections.abc import Iterable, Mapping, Sequence

from envs.core.parameters import ConfigError


def parse(words: Sequence[str], keys: Iterable[str], needed: Sequence[str] = ()) -> dict[str, str]:
    """Return the value of each key that the words set.

    Args:
        words: the words as typed.
        keys: the keys that there are; one that ends in a dot stands for all that begin with it.
        needed: the keys that must be set.

    Raises:
        ConfigError: if a word isn't key=value, there is no such key, a key is set twice, or a
            needed one is missing.
    """
    known, values = [*keys], dict[str, str]()
    for word in words:
        key, equals, value = word.partition("=")
        if not any(key == each or (each.endswith(".") and key.startswith(each)) for each in known):
            near = difflib.get_close_matches(key, known, n=1)
            advice = f"did you mean {near[0]}?" if near else f"there is {', '.join(known)}"
            raise ConfigError(f"{word}: there is no {key}; {advice}")
        if not (equals and value):
            raise ConfigError(f"{word}: must be {key}=…")
        if key in values:
            raise ConfigError(f"{word}: {key} is there twice")
        values[key] = value
    for key in needed:
        if key not in values:
            raise ConfigError(f"{key}=… is missing")
    return values


def whole(given: Mapping[str, str], key: str, low: int = 1) -> int:
    """Return the whole number that a key has.

    Raises:
        ConfigError: it has another value.
    """
    if not (given[key].isdecimal() and int(given[key]) >= low):
        raise ConfigError(f"{key}={given[key]}: must be a whole number >= {low}")
    return int(given[key])


def truth(key: str, value: str) -> bool:
    """Return the value of a key, ``true`` or ``false``, as a bool.

    Raises:
        ConfigError: it has another value.
    """
    return one_of(key, value, ("true", "false")) == "true"


def one_of(key: str, value: str, known: Sequence[str]) -> str:
    """Return the value of a key, which must be one of the known.

    Raises:
        ConfigError: it has another value.
    """
    if value not in known:
        near = difflib.get_close_matches(value, known, n=1)
        advice = f"; did you mean {near[0]}?" if near else ""
        raise ConfigError(f"{key}={value}: must be {' or '.join(known)}{advice}")
    return value
