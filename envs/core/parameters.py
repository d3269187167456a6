"""Ranges: what a field of a dataclass of parameters may hold, said once, beside the field.

A field is declared without a default, since defaults live in the YAML files alone::

    speed_mps: float = number(above=0)

`check` refuses an instance with a value outside its range; `allowed` says every range in words.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields
from math import inf
from typing import Any, get_args, get_type_hints

MOST = 2**63 - 1
"""The greatest whole number: tensors hold no greater one."""


class ConfigError(ValueError):
    """A mistake of the user's; its text is one line that says what to change."""


class OutOfRange(ConfigError):
    """A value that its key doesn't allow.

    Args:
        key: the key with its groups, as in ``env.speed_mps``.
        value: what was given.
        allowed: what may stand there, in words that complete "must be".
    """

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__(key, value, allowed)  # all three: that is what unpickling passes
        self.key, self.value, self.allowed = key, value, allowed

    def __str__(self) -> str:
        return f"{self.key}={self.value}: must be {self.allowed}"


class Parameters:
    """Base of the dataclasses whose fields are declared with their ranges."""

    def contradictions(self) -> Iterator[OutOfRange]:
        """The values that are fine alone but not together, for `check` to raise."""
        yield from ()


@dataclass(frozen=True)
class Range:
    """A set of values: the test for membership, and the same in words."""

    holds: Callable[[Any], bool]
    words: str


def number(low: float = -inf, high: float = inf, *, above: float = -inf, **default: Any) -> Any:
    """A finite number in [low, high] or, with `above`, in (above, high].

    Here and below, `default` is for files from before there was such a key.
    """
    left = f"[{low:g}" if low > above else f"({above:g}"
    right = f"{high:g}]" if high < inf else "inf)"
    return _declare(
        lambda value: _is_finite(value) and low <= value <= high and above < value,
        f"a number in {left}, {right}",
        **default,
    )


def whole(low: int, **default: Any) -> Any:
    """A whole number, at least `low`."""
    return _declare(
        lambda value: _is_whole(value) and value >= low, f"a whole number >= {low}", **default
    )


def one_of(*choices: str, **default: Any) -> Any:
    """One of at least two words."""
    *others, last = choices
    return _declare(lambda value: value in choices, f"{', '.join(others)} or {last}", **default)


def matching(pattern: str, words: str) -> Any:
    """A text that the regular expression matches from end to end; `words` tell the user which."""
    return _declare(
        lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None, words
    )


def pairs(first: str, second: str, *, above: float = -inf, other: Range | None = None) -> Any:
    """A list of pairs of finite numbers, at least one, the second number of each > `above`.

    With `other`, what that holds may stand in the place of a pair.
    """

    def is_entry(entry: Any) -> bool:
        if other is not None and other.holds(entry):
            return True
        return _is_pair(entry) and bool(entry[1] > above)

    bound = f" with {second} > {above:g}" if above > -inf else ""
    words = f"a list of at least one pair [{first}, {second}]{bound}"
    return _declare(
        lambda value: isinstance(value, list) and len(value) >= 1 and all(map(is_entry, value)),
        words if other is None else f"{words}, or {other.words}",
    )


def texts(most: int) -> Any:
    """A list of texts, empty or not, each of 1 to `most` letters."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and all(isinstance(text, str) and 1 <= len(text) <= most for text in value)
        ),
        f"a list of texts of 1 to {most} letters",
    )


def words(**default: Any) -> Any:
    """A list of different words."""
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
    """A list of whole numbers, at least one, each at least `low`."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and len(value) >= 1
            and all(_is_whole(entry) and entry >= low for entry in value)
        ),
        f"a list of at least one whole number >= {low}",
    )


def whole_or_rows(low: int, row: str) -> Any:
    """A whole number, at least `low`, or a list of rows of finite numbers, at least one."""

    def holds(value: Any) -> bool:
        if _is_whole(value):
            return bool(value >= low)
        return (
            isinstance(value, list)
            and len(value) >= 1
            and all(isinstance(each, list) and all(map(_is_finite, each)) for each in value)
        )

    return _declare(holds, f"a list of at least one {row} [number, …], or a whole number >= {low}")


def or_null(declared: Any, **default: Any) -> Any:
    """The same range, which also holds ``null``."""
    range_: Range = declared.metadata[_RANGE]
    return _declare(
        lambda value: value is None or range_.holds(value), f"{range_.words}, or null", **default
    )


def flag(**default: Any) -> Any:
    """True or false."""
    return _declare(lambda value: isinstance(value, bool), "true or false", **default)


def parameters(kinds: Iterable[str]) -> Any:
    """The parameters of one of several kinds, which its entry ``kind`` names."""
    return _declare(
        lambda value: isinstance(value, Parameters), f"the values of one of: {', '.join(kinds)}"
    )


def check(parameters: Parameters, prefix: str = "") -> None:
    """Refuses parameters with a value outside its range, nested dataclasses included.

    Args:
        parameters: an instance of a dataclass whose fields carry ranges. The range of a mapping
            is the range of each of its values.
        prefix: what the keys begin with, ``env.`` for the fields of a nested ``env``.

    Raises:
        OutOfRange: for the first such value.
    """
    for item in fields(parameters):  # type: ignore[arg-type]  # every subclass is a dataclass
        key, value = prefix + item.name, getattr(parameters, item.name)
        if isinstance(value, Parameters):
            check(value, f"{key}.")
            continue
        if value is None and _RANGE not in item.metadata:  # a group that isn't chosen
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
    """What each key may hold, in words that complete "must be".

    Args:
        schema: a dataclass whose fields carry ranges.
        prefix: what the keys begin with.

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
    # Any, as in dataclasses' own stubs: the result stands where a value of the field's type goes.
    return field(metadata={_RANGE: Range(holds, words)}, **default)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_finite, value))


def _is_finite(value: Any) -> bool:
    return (isinstance(value, float) or _is_whole(value)) and -inf < value < inf
