"""The words key=value of commands without Hydra, or one line on what is wrong with them."""

import difflib
from collections.abc import Mapping, Sequence

from envs.core.parameters import ConfigError


def parse(
    words: Sequence[str], defaults: Mapping[str, str], needed: Sequence[str]
) -> dict[str, str]:
    """Return a value for every key.

    Args:
        words: as typed.
        defaults: of every key that there is; empty where there is none.
        needed: the keys that must be typed.

    Raises:
        ConfigError: a word isn't key=value, there is no such key, or one is missing.
    """
    given = dict(defaults)
    for word in words:
        key, equals, value = word.partition("=")
        if key not in given:
            near = difflib.get_close_matches(key, given, n=1)
            advice = f"did you mean {near[0]}=…?" if near else f"there is {', '.join(given)}"
            raise ConfigError(f"{word}: {advice}")
        if not (equals and value):
            raise ConfigError(f"{word}: must be {key}=…")
        given[key] = value
    for key in needed:
        if not given[key]:
            raise ConfigError(f"{key}=… is missing")
    return given


def whole(given: Mapping[str, str], key: str, low: int = 1) -> int:
    """Return the whole number that a key has.

    Raises:
        ConfigError: it has another value.
    """
    if not (given[key].isdecimal() and int(given[key]) >= low):
        raise ConfigError(f"{key}={given[key]}: must be a whole number >= {low}")
    return int(given[key])
