"""Read and write rules as JSON."""

import json
from collections.abc import Sequence
from math import inf, isfinite
from typing import Any

import torch

from fnnq_torchrl.agent.rules.errors import Place, RulesError, shown
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.system import MOST_RULES, FuzzySystem

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


def read(text: str, file: str) -> tuple[FuzzySystem, tuple[float, ...]]:
    """Read a system; arguments, result and errors as in :func:`.sentences.read`."""
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        raise Place(file, error.lineno, error.colno).error(error.msg) from None
    except (ValueError, RecursionError):  # ValueError: an integer with too many digits
        raise Place(file, 1).error("a number is too long, or a list too deep") from None
    try:
        root = _Node(content, "")
        if (given := root.get("format").text()) != FORMAT:
            raise RulesError(f"format: {shown(given)}; expected {FORMAT!r}")
        inputs = tuple(_variable(node) for node in root.get("inputs").items())
        candidates = tuple(root.get("candidates").number_list())
        if [*candidates] != sorted(set(candidates)):
            raise RulesError("candidates: expected rising numbers")
        shape = [len(variable.labels) for variable in inputs]
        numbers = root.get("consequents").nested(shape)
        system = FuzzySystem(
            inputs,
            root.get("output").text(),
            torch.tensor(numbers, dtype=torch.float64).reshape(shape),
            root.get("t_norm").text(),
            root.get("elsewhere").text(),
        )
    except RulesError as error:
        raise RulesError(f"{file}: {error}") from None
    return system, candidates


class _Node:
    """A value in the file and its path, such as ``inputs[0].labels``."""

    def __init__(self, value: Any, path: str) -> None:
        self._value, self._path = value, path

    def get(self, key: str) -> "_Node":
        if not isinstance(self._value, dict) or key not in self._value:
            raise RulesError(f"{self._path or 'the file'}: expected a mapping with {key!r}")
        return _Node(self._value[key], f"{self._path}.{key}".lstrip("."))

    def items(self) -> list["_Node"]:
        if not isinstance(self._value, list) or len(self._value) > MOST_RULES:
            raise self._error("a list")
        return [_Node(each, f"{self._path}[{i}]") for i, each in enumerate(self._value)]

    def text(self) -> str:
        if not isinstance(self._value, str) or not 1 <= len(self._value) <= 200:
            raise self._error("a text of 1 to 200 letters")
        return self._value

    def number(self) -> float:
        is_number = isinstance(self._value, int | float) and not isinstance(self._value, bool)
        try:
            if is_number and isfinite(self._value):
                return float(self._value)
        except OverflowError:
            pass
        raise self._error("a finite number")

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
            raise self._error(f"{shape[0]} entries, one for each label")
        return [number for node in nodes for number in node.nested(shape[1:])]

    def _error(self, expected: str) -> RulesError:
        kind = type(self._value).__name__
        given = shown(self._value) if isinstance(self._value, str | int | float) else kind
        return RulesError(f"{self._path}: {given}; expected {expected}")


def _variable(node: _Node) -> Variable:
    labels = tuple(
        Label(
            each.get("name").text(),
            each.get("kind").text(),
            tuple(each.get("parameters").number_list()),
        )
        for each in node.get("labels").items()
    )
    return Variable(
        node.get("name").text(),
        labels,
        node.get("low").bound(-inf),
        node.get("high").bound(inf),
    )
