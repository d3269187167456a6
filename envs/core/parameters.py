"""Dataclasses of parameters, whose fields are declared with the range of their values.

A field has no default, since defaults stand in the YAML files alone::

    speed_mps: float = number(above=0)

`check` refuses an instance with a value outside its range; `allowed` gives every range in words.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields
from math import inf
from typing import Any, get_args, get_type_hints

MOST = 2**63 - 1
"""The greatest whole number that a tensor holds."""


class ConfigError(ValueError):
    """A mistake in the user's input; its text is one line that says what to change."""


class OutOfRange(ConfigError):
    """A value that its key doesn't allow.

    Args:
        key: the key with its groups, as in ``env.speed_mps``.
        value: the value given.
        allowed: the values that the key allows, in words that complete "must be".
    """

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__(key, value, allowed)  # all three, which unpickling passes again
        self.key, self.value, self.allowed = key, value, allowed

    def __str__(self) -> str:
        return f"{self.key}={self.value}: must be {self.allowed}"


class Parameters:
    """Base of the dataclasses whose fields are declared with their ranges."""

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield the values that are allowed alone but not together; `check` raises the first."""
        yield from ()


@dataclass(frozen=True)
class Range:
    """A set of values: a test of whether it holds a value, and its description in words."""

    holds: Callable[[Any], bool]
    words: str


def number(low: float = -inf, high: float = inf, *, above: float = -inf) -> Any:
    """A finite number in [low, high] or, with `above`, in (above, high]."""
    left = f"[{low:g}" if low > above else f"({above:g}"
    right = f"{high:g}]" if high < inf else "inf)"
    return _declare(
        lambda value: _is_finite(value) and low <= value <= high and above < value,
        f"a number in {left}, {right}",
    )


def whole(low: int) -> Any:
    """A whole number, at least `low`."""
    return _declare(lambda value: _is_whole(value) and value >= low, f"a whole number >= {low}")


def one_of(*choices: str) -> Any:
    """One of the given words, of which there are at least two."""
    *others, last = choices
    return _declare(lambda value: value in choices, f"{', '.join(others)} or {last}")


def matching(pattern: str, words: str) -> Any:
    """A text that a regular expression matches as a whole; `words` describe it to the user."""
    return _declare(
        lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None, words
    )


def pairs(first: str, second: str, *, above: float = -inf) -> Any:
    """A list of at least one pair of finite numbers, each with a second number > `above`."""

    def holds(value: Any) -> bool:
        return (
            isinstance(value, list)
            and len(value) >= 1
            and all(_is_pair(pair) and pair[1] > above for pair in value)
        )

    bound = f" with {second} > {above:g}" if above > -inf else ""
    return _declare(holds, f"a list of at least one pair [{first}, {second}]{bound}")


def texts(most: int) -> Any:
    """A list of texts, each of 1 to `most` letters; it may be empty."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and all(isinstance(text, str) and 1 <= len(text) <= most for text in value)
        ),
        f"a list of texts of 1 to {most} letters",
    )


def words(**default: Any) -> Any:
    """A list of different words; `default` is for files from before there was such a key."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and all(isinstance(word, str) and re.fullmatch(_WORD, word) for word in value)
            and len({*value}) == len(value)
        ),
        "a list of different words of letters, digits and _, no digit first",
        **default,
    )


def rising_pair(first: str, second: str) -> Any:
    """A list of two finite numbers, the second above the first."""
    return _declare(
        lambda value: _is_pair(value) and value[0] < value[1],
        f"a pair [{first}, {second}] with {first} < {second}",
    )


def wholes(low: int) -> Any:
    """A list of at least one whole number, each at least `low`."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and len(value) >= 1
            and all(_is_whole(entry) and entry >= low for entry in value)
        ),
        f"a list of at least one whole number >= {low}",
    )


def whole_or_rows(low: int, row: str) -> Any:
    """A whole number, at least `low`, or a list of at least one row of finite numbers."""

    def holds(value: Any) -> bool:
        if _is_whole(value):
            return bool(value >= low)
        return (
            isinstance(value, list)
            and len(value) >= 1
            and all(isinstance(each, list) and all(map(_is_finite, each)) for each in value)
        )

    return _declare(holds, f"a list of at least one {row} [number, …], or a whole number >= {low}")


def or_null(declared: Any) -> Any:
    """A declared range, extended by ``null``."""
    range_: Range = declared.metadata[_RANGE]
    return _declare(lambda value: value is None or range_.holds(value), f"{range_.words}, or null")


def flag() -> Any:
    """True or false."""
    return _declare(lambda value: isinstance(value, bool), "true or false")


def parameters(kinds: Iterable[str]) -> Any:
    """The parameters of one of several kinds, named by the entry ``kind``."""
    return _declare(
        lambda value: isinstance(value, Parameters), f"the values of one of: {', '.join(kinds)}"
    )


def check(parameters: Parameters, prefix: str = "") -> None:
    """Refuse parameters with a value outside its range, nested dataclasses included.

    Args:
        parameters: an instance of a dataclass whose fields have ranges. The range of a mapping
            applies to each of its values.
        prefix: the beginning of every key, as ``env.`` for the fields of a nested ``env``.

    Raises:
        OutOfRange: for the first such value.
    """
    for item in fields(parameters):  # type: ignore[arg-type]  # every subclass is a dataclass
        key, value = prefix + item.name, getattr(parameters, item.name)
        if isinstance(value, Parameters):
            check(value, f"{key}.")
            continue
        if value is None and _RANGE not in item.metadata:  # an optional group, not chosen
            continue
        if _is_whole(value) and value > MOST:
            raise OutOfRange(key, value, f"at most 2**63 - 1 = {MOST}")
        entries = value if isinstance(value, dict) else {None: value}
        for entry, held in entries.items():
            if not item.metadata[_RANGE].holds(held):
                name = key if entry is None else f"{key}.{entry}"
                raise OutOfRange(name, held, item.metadata[_RANGE].words)
    for found in parameters.contradictions():
        raise OutOfRange(prefix + found.key, found.value, found.allowed)


def allowed(schema: type[Parameters], prefix: str = "") -> dict[str, str]:
    """Return the range of each key, in words that complete "must be".

    Args:
        schema: a dataclass whose fields have ranges.
        prefix: the beginning of every key.

    Returns:
        The words by key, nested keys with their groups: ``{"env.speed_mps": "a number in …"}``.
    """
    words: dict[str, str] = {}
    kinds = get_type_hints(schema)
    for item in fields(schema):  # type: ignore[arg-type]  # every subclass is a dataclass
        key, kind = prefix + item.name, kinds[item.name]
        # `Group | None` is a group that may be absent.
        groups = [
            of
            for of in (kind, *get_args(kind))
            if isinstance(of, type) and issubclass(of, Parameters)
        ]
        if groups:
            words |= allowed(groups[0], f"{key}.")
        else:
            words[key] = item.metadata[_RANGE].words
    return words


_WORD = "[A-Za-z_][A-Za-z0-9_]{0,63}"

_RANGE = "range"  # the key of a field's Range in its metadata


def _declare(holds: Callable[[Any], bool], words: str, **default: Any) -> Any:
    # Any, as in dataclasses' own stubs: it is assigned to fields of any type.
    return field(metadata={_RANGE: Range(holds, words)}, **default)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_finite, value))


def _is_finite(value: Any) -> bool:
    return (isinstance(value, float) or _is_whole(value)) and -inf < value < inf
