"""Read and write rules as JSON."""

import json
from collections.abc import Callable, Iterable, Sequence
from json import decoder, scanner
from math import inf, isfinite
from typing import Any, TypeVar

import torch

from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices, shown
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.parts import Content, Definitions
from fnnq_torchrl.agent.rules.system import MOST_RULES, FuzzySystem
from fnnq_torchrl.equations.membership_functions import (
    ELSEWHERE,
    MEMBERSHIP_FUNCTIONS,
    T_NORMS,
)

_Built = TypeVar("_Built")
_Scan = Callable[[str, int], tuple[Any, int]]

FORMAT = "rules of fnnq_torchrl, 1"


def write(system: FuzzySystem, candidates: Sequence[float] = ()) -> str:
    """Return JSON, with null for an infinite bound; arguments as in :func:`.sentences.write`."""
    content = {
        "format": FORMAT,
        "inputs": [
            {
                "name": variable.name,
                "low": variable.low if isfinite(variable.low) else None,
                "high": variable.high if isfinite(variable.high) else None,
                "labels": [
                    {"name": label.name, "kind": label.kind, "parameters": [*label.parameters]}
                    for label in variable.labels
                ],
            }
            for variable in system.inputs
        ],
        "output": system.output,
        "t_norm": system.t_norm,
        "elsewhere": system.elsewhere,
        "candidates": [*candidates],
        "consequents": system.consequents.tolist(),
    }
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=True) + "\n"


def read(text: str, file: str) -> Content:
    """Read a system; arguments, result and errors as in :func:`.sentences.read`."""
    try:
        root: _Node = json.loads(text, cls=_Decoder)
    except json.JSONDecodeError as error:
        raise Place(file, error.lineno, error.colno).error(error.msg) from None
    except (ValueError, RecursionError):  # ValueError: an integer with too many digits
        raise Place(file, 1).error("a number is too long, or a list too deep") from None
    try:
        return _content(root, text, file)
    except _Wrong as error:
        raise _place(text, file, error.index).error(error.message) from None


def _content(root: "_Node", text: str, file: str) -> Content:
    if (given := root.get("format").text()) != FORMAT:
        raise root.get("format").error(f"{shown(given)}; expected {FORMAT!r}")
    nodes = root.get("inputs").items()
    variables = tuple(map(_variable, nodes))
    candidates = tuple(root.get("candidates").number_list())
    if [*candidates] != sorted(set(candidates)):
        raise root.get("candidates").error("expected rising numbers")
    shape = [len(variable.labels) for variable in variables]
    numbers = root.get("consequents").nested(shape)
    choices_of = {"t_norm": T_NORMS, "elsewhere": ELSEWHERE}
    settings = {name: root.get(name).one_of(known) for name, known in choices_of.items()}
    indices: dict[int | str, int] = {i: node.index for i, node in enumerate(nodes)}
    indices |= {name: root.get(name).index for name in settings}
    places = {key: _place(text, file, index) for key, index in indices.items()}
    return Content.build(
        Definitions(file, variables, settings, places),
        root.get("output").text(),
        torch.tensor(numbers, dtype=torch.float64).reshape(shape),
        _place(text, file, root.get("inputs").index),
        candidates,
    )


def _place(text: str, file: str, index: int) -> Place:
    return Place(file, text.count("\n", 0, index) + 1, index - text.rfind("\n", 0, index))


class _Wrong(Exception):
    """An error at an index of the text."""

    def __init__(self, index: int, message: str) -> None:
        super().__init__(message)
        self.index, self.message = index, message


class _Decoder(json.JSONDecoder):
    """A decoder that returns every value as a node, with its index in the text."""

    def __init__(self) -> None:
        super().__init__()

        def located(scan: _Scan) -> _Scan:
            def scan_at(text: str, index: int) -> tuple[_Node, int]:
                value, end = scan(text, index)
                return _Node(value, index), end

            return scan_at

        of_object: Any = decoder.JSONObject  # type: ignore[attr-defined]
        of_array: Any = decoder.JSONArray  # type: ignore[attr-defined]
        self.parse_object = lambda at, strict, scan, *hooks: of_object(
            at, strict, located(scan), *hooks
        )
        self.parse_array = lambda at, scan, *hooks: of_array(at, located(scan), *hooks)
        # The scanner in C would not call these two.
        self.scan_once = located(scanner.py_make_scanner(self))  # type: ignore[attr-defined]


class _Node:
    """A value in the file, its index in the text, and its path, such as ``inputs[0].labels``."""

    __slots__ = ("_path", "_value", "index")

    def __init__(self, value: Any, index: int, path: str = "") -> None:
        self._value, self.index, self._path = value, index, path

    def get(self, key: str) -> "_Node":
        if not isinstance(self._value, dict) or key not in self._value:
            raise self.error(f"expected a mapping with {key!r}")
        return self._value[key]._at(f"{self._path}.{key}".lstrip("."))

    def items(self) -> list["_Node"]:
        if not isinstance(self._value, list) or len(self._value) > MOST_RULES:
            raise self._misfit("a list")
        return [each._at(f"{self._path}[{i}]") for i, each in enumerate(self._value)]

    def _at(self, path: str) -> "_Node":
        return _Node(self._value, self.index, path)

    def text(self) -> str:
        if not isinstance(self._value, str) or not 1 <= len(self._value) <= 200:
            raise self._misfit("a text of 1 to 200 letters")
        return self._value

    def number(self) -> float:
        is_number = isinstance(self._value, int | float) and not isinstance(self._value, bool)
        try:
            if is_number and isfinite(self._value):
                return float(self._value)
        except OverflowError:
            pass
        raise self._misfit("a finite number")

    def number_list(self) -> list[float]:
        return [node.number() for node in self.items()]

    def bound(self, infinity: float) -> float:
        return infinity if self._value is None else self.number()

    def nested(self, shape: Sequence[int]) -> list[float]:
        """Return the numbers of nested lists of a given shape, flattened."""
        if not shape:
            return [self.number()]
        nodes = self.items()
        if len(nodes) != shape[0]:
            raise self._misfit(f"{shape[0]} entries, one for each label")
        return [number for node in nodes for number in node.nested(shape[1:])]

    def one_of(self, names: Iterable[str]) -> str:
        if (given := self.text()) not in names:
            raise self.error(f"{shown(given)}: {choices(given, names)}")
        return given

    def build(self, kind: Callable[..., _Built], *parts: Any) -> _Built:
        """Build a label or a variable from its parts; an error is one of this node."""
        try:
            return kind(*parts)
        except RulesError as error:
            raise self.error(str(error)) from None

    def error(self, message: str) -> _Wrong:
        return _Wrong(self.index, f"{self._path or 'the file'}: {message}")

    def _misfit(self, expected: str) -> _Wrong:
        kind = type(self._value).__name__
        given = shown(self._value) if isinstance(self._value, str | int | float) else kind
        return self.error(f"{given}; expected {expected}")


def _variable(node: _Node) -> Variable:
    labels = tuple(
        each.build(
            Label,
            each.get("name").text(),
            each.get("kind").one_of(MEMBERSHIP_FUNCTIONS),
            tuple(each.get("parameters").number_list()),
        )
        for each in node.get("labels").items()
    )
    low, high = node.get("low").bound(-inf), node.get("high").bound(inf)
    return node.build(Variable, node.get("name").text(), labels, low, high)
