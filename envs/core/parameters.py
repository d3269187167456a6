"""Ranges: what a field of a dataclass of parameters may hold, said once, beside the field.

A field is declared without a default, since defaults live in the YAML files alone::

    speed_mps: float = number(above=0)

`check` refuses an instance with a value outside its range; `allowed` says every range in words.
"""

import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from math import inf
from typing import Any, TypeVar, get_args, get_type_hints

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
    """One of at least two words."""
    *others, last = choices
    return _declare(lambda value: value in choices, f"{', '.join(others)} or {last}")


def matching(pattern: str, words: str) -> Any:
    """A text that the regular expression matches from end to end; `words` tell the user which."""
    return _declare(
        lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None, words
    )


def pairs(first: str, second: str, *, above: float = -inf) -> Any:
    """A list of pairs of finite numbers, at least one, the second number of each > `above`."""

    def holds(value: Any) -> bool:
        return (
            isinstance(value, list)
            and len(value) >= 1
            and all(_is_pair(pair) and pair[1] > above for pair in value)
        )

    bound = f" with {second} > {above:g}" if above > -inf else ""
    return _declare(holds, f"a list of at least one pair [{first}, {second}]{bound}")


def number_or_range(low: float = -inf, *, above: float = -inf) -> Any:
    """A finite number, at least `low` or above `above`, or a pair [least, greatest] of such."""
    bound = f", >= {low:g}" if low > -inf else f", > {above:g}" if above > -inf else ""
    return _declare(
        lambda value: _is_spread(value) and all(low <= end and above < end for end in _ends(value)),
        f"a number, or a range [least, greatest] to draw from{bound}",
    )


def place() -> Any:
    """A point [x, y], each a number or a range [least, greatest]."""
    return _declare(
        lambda value: isinstance(value, list) and len(value) == 2 and all(map(_is_spread, value)),
        "a point [x, y], each a number or a range [least, greatest] to draw from",
    )


def point(first: str, second: str, *, above: float = -inf) -> Any:
    """A pair of finite numbers, each above `above`."""
    bound = f" of numbers > {above:g}" if above > -inf else ""
    return _declare(
        lambda value: _is_pair(value) and min(value) > above, f"a pair [{first}, {second}]{bound}"
    )


def rows(*names: str, least: int = 1) -> Any:
    """A list of at least so many rows of finite numbers, one for each name."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and len(value) >= least
            and all(
                isinstance(row, list) and len(row) == len(names) and all(map(_is_finite, row))
                for row in value
            )
        ),
        f"a list of at least {least} [{', '.join(names)}]",
    )


def mappings() -> Any:
    """A list of mappings, empty or not; who has it checks what is in them (`made_from`)."""
    return _declare(
        lambda value: isinstance(value, list) and all(isinstance(entry, dict) for entry in value),
        "a list of mappings {key: value, …}",
    )


def groups() -> Any:
    """A list of lists of different names, at least one in each."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and len(value) >= 1
            and all(
                isinstance(group, list)
                and len(group) >= 1
                and all(isinstance(name, str) for name in group)
                and len({*group}) == len(group)
                for group in value
            )
        ),
        "a list of groups [name, …] of different names",
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


def or_null(declared: Any) -> Any:
    """The same range, which also holds ``null``."""
    range_: Range = declared.metadata[_RANGE]
    return _declare(lambda value: value is None or range_.holds(value), f"{range_.words}, or null")


def flag() -> Any:
    """True or false."""
    return _declare(lambda value: isinstance(value, bool), "true or false")


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


Made = TypeVar("Made", bound=Parameters)


def made_from(schema: type[Made], values: Mapping[str, Any], key: str) -> Made:
    """Return the parameters that a mapping in a list has, checked.

    Args:
        schema: a dataclass whose fields carry ranges.
        values: by the names of its fields.
        key: of the mapping, as in ``obstacles[0]``.

    Raises:
        OutOfRange: a name is unknown or missing, or its value isn't allowed.
    """
    known = {item.name: item for item in fields(schema)}  # type: ignore[arg-type]
    for name, value in values.items():
        if name not in known:
            near = difflib.get_close_matches(str(name), known, n=1)
            meant = f"; did you mean {near[0]}?" if near else ""
            raise OutOfRange(f"{key}.{name}", value, f"one of the keys {', '.join(known)}{meant}")
    for name, item in known.items():
        if name not in values:
            raise OutOfRange(f"{key}.{name}", "???", item.metadata[_RANGE].words)
    made = schema(**values)
    check(made, f"{key}.")
    return made


_RANGE = "range"  # the key of a field's Range in its metadata


def _declare(holds: Callable[[Any], bool], words: str) -> Any:
    # Any, as in dataclasses' own stubs: the result stands where a value of the field's type goes.
    return field(metadata={_RANGE: Range(holds, words)})


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_finite, value))


def _is_spread(value: Any) -> bool:
    return _is_finite(value) or (_is_pair(value) and bool(value[0] <= value[1]))


def _ends(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _is_finite(value: Any) -> bool:
    return (isinstance(value, float) or _is_whole(value)) and -inf < value < inf
