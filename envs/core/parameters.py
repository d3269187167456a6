"""Dataclasses of parameters: each field is declared with its range of allowed values.

Fields have no defaults, because only the YAML files hold defaults::

    speed_mps: float = number(above=0)

`check` raises an error for a value outside its range; `allowed` describes every range in words.
"""

import difflib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from math import inf
from typing import Any, TypeVar, get_args, get_type_hints

MOST = 2**63 - 1
"""The largest whole number allowed, that of an int64 tensor."""


class ConfigError(ValueError):
    """An error in the user's input; its message is one line that says what to change."""


class OutOfRange(ConfigError):
    """An error for a value that its key doesn't allow.

    Args:
        key: the key with its groups, as in ``env.speed_mps``.
        value: the value given.
        allowed: the allowed values in words, which the message puts after "must be".
    """

    def __init__(self, key: str, value: object, allowed: str) -> None:
        super().__init__(key, value, allowed)  # unpickling calls the class with these three
        self.key, self.value, self.allowed = key, value, allowed

    def __str__(self) -> str:
        # YAML and the command line write null, true and false in small letters.
        constant = self.value is None or isinstance(self.value, bool)
        value = json.dumps(self.value) if constant else self.value
        return f"{self.key}={value}: must be {self.allowed}"


class Parameters:
    """The base class of dataclasses whose fields are declared with their ranges."""

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield an error for each value that conflicts with another; `check` raises the first."""
        yield from ()


@dataclass(frozen=True)
class Range:
    """A set of allowed values: ``holds(value)`` tests a value, ``words`` describe the set."""

    holds: Callable[[Any], bool]
    words: str


def number(low: float = -inf, high: float = inf, *, above: float = -inf, **default: Any) -> Any:
    """Declare a field for a finite number in [low, high] or, with `above`, in (above, high].

    Here and below, `default` serves files that are older than the key.
    """
    left = f"[{low:g}" if low > above else f"({above:g}"
    right = f"{high:g}]" if high < inf else "inf)"
    return _declare(
        lambda value: _is_finite(value) and low <= value <= high and above < value,
        f"a number in {left}, {right}",
        **default,
    )


def whole(low: int, **default: Any) -> Any:
    """Declare a field for a whole number >= `low`."""
    return _declare(
        lambda value: _is_whole(value) and value >= low, f"a whole number >= {low}", **default
    )


def one_of(*choices: str, **default: Any) -> Any:
    """Declare a field for one of the given words, at least two."""
    *others, last = choices
    return _declare(lambda value: value in choices, f"{', '.join(others)} or {last}", **default)


def matching(pattern: str, words: str) -> Any:
    """Declare a field for a text that fully matches `pattern`; `words` describe such a text."""
    return _declare(
        lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None, words
    )


def pairs(first: str, second: str, *, above: float = -inf, other: Range | None = None) -> Any:
    """Declare a field for a list of at least one pair of finite numbers.

    Args:
        first, second: the names of a pair's numbers in the error.
        above: the number that every second number must exceed.
        other: the range of entries that are allowed instead of a pair.
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


def number_or_range(low: float = -inf, *, above: float = -inf) -> Any:
    """Declare a field for a finite number, or a range [least, greatest] of them to draw from."""
    bound = f", >= {low:g}" if low > -inf else f", > {above:g}" if above > -inf else ""
    return _declare(
        lambda value: _is_spread(value) and all(low <= end and above < end for end in _ends(value)),
        f"a number, or a range [least, greatest] to draw from{bound}",
    )


def place() -> Any:
    """Declare a field for a point [x, y], each a number or a range [least, greatest]."""
    return _declare(
        lambda value: isinstance(value, list) and len(value) == 2 and all(map(_is_spread, value)),
        "a point [x, y], each a number or a range [least, greatest] to draw from",
    )


def point(first: str, second: str, *, above: float = -inf) -> Any:
    """Declare a field for a pair of finite numbers, each above `above`."""
    bound = f" of numbers > {above:g}" if above > -inf else ""
    return _declare(
        lambda value: _is_pair(value) and min(value) > above, f"a pair [{first}, {second}]{bound}"
    )


def rows(*names: str, least: int = 1) -> Any:
    """Declare a field for a list of at least `least` rows with a finite number for each name."""
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
    """Declare a field for a list of mappings, which `made_from` checks; the list may be empty."""
    return _declare(
        lambda value: isinstance(value, list) and all(isinstance(entry, dict) for entry in value),
        "a list of mappings {key: value, …}",
    )


def groups() -> Any:
    """Declare a field for a list of groups, each of at least one name and none twice."""
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
    """Declare a field for a list of texts of 1 to `most` characters; the list may be empty."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and all(isinstance(text, str) and 1 <= len(text) <= most for text in value)
        ),
        f"a list of texts of 1 to {most} characters",
    )


def words(**default: Any) -> Any:
    """Declare a field for a list of different words."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and all(isinstance(word, str) and re.fullmatch(_WORD, word) for word in value)
            and len({*value}) == len(value)
        ),
        "a list of different words of letters, digits and _, no digit first",
        **default,
    )


def some_of(*choices: str, **default: Any) -> Any:
    """Declare a field for a list of at least one of the given words, none twice."""
    *others, last = choices
    return _declare(
        lambda value: (
            isinstance(value, list)
            and len(value) >= 1
            and all(each in choices for each in value)
            and len({*value}) == len(value)
        ),
        f"a list of at least one of {', '.join(others)} and {last}",
        **default,
    )


def rising_pair(first: str, second: str) -> Any:
    """Declare a field for a pair of finite numbers, named in errors; the second is greater."""
    return _declare(
        lambda value: _is_pair(value) and value[0] < value[1],
        f"a pair [{first}, {second}] with {first} < {second}",
    )


def wholes(low: int) -> Any:
    """Declare a field for a list of at least one whole number, each >= `low`."""
    return _declare(
        lambda value: (
            isinstance(value, list)
            and len(value) >= 1
            and all(_is_whole(entry) and entry >= low for entry in value)
        ),
        f"a list of at least one whole number >= {low}",
    )


def whole_or_rows(low: int, row: str) -> Any:
    """Declare a field for a whole number or a list of at least one row of finite numbers.

    Args:
        low: the smallest whole number allowed.
        row: the name of a row in the error.
    """

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
    """Declare a field for ``null`` (None) or a value in the range of another declared field."""
    range_: Range = declared.metadata[_RANGE]
    return _declare(
        lambda value: value is None or range_.holds(value), f"{range_.words}, or null", **default
    )


def plain(**default: Any) -> Any:
    """Declare a field for a mapping of plain values; the range is that of each value."""
    return _declare(
        lambda value: value is None or isinstance(value, str | bool) or _is_finite(value),
        "a text, a number, true, false or null",
        **default,
    )


def flag(**default: Any) -> Any:
    """Declare a boolean field."""
    return _declare(lambda value: isinstance(value, bool), "true or false", **default)


def parameters(kinds: Iterable[str]) -> Any:
    """Declare a field for a group of parameters; the error names `kinds` as its choices."""
    return _declare(
        lambda value: isinstance(value, Parameters), f"the values of one of: {', '.join(kinds)}"
    )


def check(parameters: Parameters, prefix: str = "") -> None:
    """Raise an error if a value is outside its range, in nested dataclasses too.

    Args:
        parameters: an instance of a dataclass whose fields have ranges. The range of a field that
            holds a mapping applies to each value in the mapping.
        prefix: text before every key in the error, as ``env.`` for the fields of ``env``.

    Raises:
        OutOfRange: for the first value outside its range or in conflict with another.
    """
    for item in fields(parameters):  # type: ignore[arg-type]  # every subclass is a dataclass
        key, value = prefix + item.name, getattr(parameters, item.name)
        if isinstance(value, Parameters):
            check(value, f"{key}.")
            continue
        if value is None and _RANGE not in item.metadata:  # an optional group that isn't chosen
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


def rounded_misfits(
    parameters: Parameters, round_to: Callable[[float], float]
) -> Iterator[OutOfRange]:
    """Yield an error for each valid value that leaves its range when its numbers are rounded.

    Args:
        parameters: as for `check`; the values of nested dataclasses aren't checked.
        round_to: rounds a number to the precision of the computation; infinite on overflow.
    """
    for item in fields(parameters):  # type: ignore[arg-type]  # every subclass is a dataclass
        value = getattr(parameters, item.name)
        entries = value if isinstance(value, dict) else {None: value}
        for entry, held in entries.items():
            range_ = item.metadata.get(_RANGE)
            if range_ is not None and not range_.holds(_rounded(held, round_to)):
                name = item.name if entry is None else f"{item.name}.{entry}"
                yield OutOfRange(name, held, range_.words)


def _rounded(value: Any, round_to: Callable[[float], float]) -> Any:
    if isinstance(value, float):
        return round_to(value)
    if isinstance(value, list):
        return [_rounded(each, round_to) for each in value]
    if isinstance(value, dict):
        return {key: _rounded(each, round_to) for key, each in value.items()}
    return value


def allowed(schema: type[Parameters], prefix: str = "") -> dict[str, str]:
    """Return the range of each key in words that can follow "must be".

    Args:
        schema: a dataclass whose fields have ranges.
        prefix: text before every key.

    Returns:
        The range of each key, with its groups: ``{"env.speed_mps": "a number in (0, inf)", …}``.
    """
    words: dict[str, str] = {}
    kinds = get_type_hints(schema)
    for item in fields(schema):  # type: ignore[arg-type]  # every subclass is a dataclass
        key, kind = prefix + item.name, kinds[item.name]
        # The type `Group | None` is that of an optional group.
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


_WORD = "[A-Za-z_][A-Za-z0-9_]{0,63}"
_RANGE = "range"  # the key of the Range in a field's metadata


def _declare(holds: Callable[[Any], bool], words: str, **default: Any) -> Any:
    # The result is assigned to fields of all types, so it is Any, as in the stubs of dataclasses.
    return field(metadata={_RANGE: Range(holds, words)}, **default)


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
