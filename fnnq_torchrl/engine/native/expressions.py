"""What a lane computes in a step: scalar expressions, each of them once."""

from collections.abc import Iterable
from math import copysign
from typing import Any

import torch

DTYPES = (torch.float32, torch.float64, torch.int32, torch.int64, torch.bool)

COMPARISONS = ("eq", "ne", "lt", "le", "gt", "ge")
_OF_BOOLEANS = {
    "add": "bitwise_or",
    "mul": "bitwise_and",
    "maximum": "bitwise_or",
    "minimum": "bitwise_and",
}


class Unsupported(Exception):
    """The step has something for which this compiler has no translation."""


class Expression:
    """A number that a lane computes. Equal expressions are one object, so ``is`` compares them.

    Attributes:
        op: ``constant``, ``input``, or an operation (:mod:`.source` has them).
        dtype: of the number.
        args: what it is computed from: expressions, but for ``constant`` (a Python number),
            ``input`` (leaf, element, lane) and ``lookup`` (a table of Python numbers first).
        operands: those of ``args`` that are expressions.
    """

    __slots__ = ("args", "dtype", "op", "operands")

    def __init__(self, op: str, dtype: torch.dtype, args: tuple[Any, ...]) -> None:
        self.op, self.dtype, self.args = op, dtype, args
        self.operands = [arg for arg in args if isinstance(arg, Expression)]


def in_order(results: Iterable[Expression]) -> list[Expression]:
    """All that the results are computed from, each after its operands and near its first use."""
    order: dict[Expression, None] = {}
    stack = [*results][::-1]
    while stack:
        waiting = [operand for operand in stack[-1].operands if operand not in order]
        if waiting:
            stack += waiting[::-1]
        else:
            order.setdefault(stack.pop())
    return [*order]


class Expressions:
    """Makes expressions, simplified where that changes no bit of any result.

    Args:
        most: how many different ones there may be.
    """

    def __init__(self, most: int) -> None:
        self._known: dict[tuple[Any, ...], Expression] = {}
        self._most = most

    def constant(self, value: float | bool, dtype: torch.dtype) -> Expression:
        """A number that is known beforehand, as its dtype can hold it."""
        if dtype is torch.bool:
            value = bool(value)
        elif dtype in (torch.int32, torch.int64):
            half = 1 << (8 * dtype.itemsize - 1)
            value = (int(value) + half) % (2 * half) - half
        else:
            value = torch.tensor(value, dtype=dtype).item()
        # The text tells 0.0 from -0.0, and one NaN from no other.
        return self._one("constant", dtype, (value,), key=repr(value))

    def input(self, leaf: int, element: int, lane: int, dtype: torch.dtype) -> Expression:
        """An element of what a lane is given: ``leaf`` numbers the tensors."""
        return self._one("input", dtype, (leaf, element, lane))

    def lookup(self, table: tuple[float, ...], index: Expression, dtype: torch.dtype) -> Expression:
        """The table's entry of that number, which must be one of them."""
        return self._one("lookup", dtype, (table, index), key=(repr(table), index))

    def cast(self, value: Expression, dtype: torch.dtype) -> Expression:
        """The same number in another dtype."""
        if value.dtype is dtype:
            return value
        if value.op == "constant" and value.args[0] == value.args[0]:
            return self.constant(value.args[0], dtype)
        return self._one("cast", dtype, (value,))

    def __call__(self, op: str, dtype: torch.dtype, *args: Expression) -> Expression:
        """The result of an operation."""
        if all(arg.dtype is torch.bool for arg in args):
            if op in COMPARISONS:  # of numbers: a mask isn't one
                args = tuple(self.cast(arg, torch.int32) for arg in args)
            op = _OF_BOOLEANS.get(op, op)
        if (simpler := _simpler(op, *args)) is not None:
            return simpler
        return self._one(op, dtype, args)

    def _one(
        self, op: str, dtype: torch.dtype, args: tuple[Any, ...], key: object = None
    ) -> Expression:
        if dtype not in DTYPES:
            raise Unsupported(f"no translation for {dtype}")
        key = (op, dtype, key if key is not None else args)
        if (known := self._known.get(key)) is None:
            if len(self._known) == self._most:
                raise Unsupported(f"more than {self._most:,} scalar operations")
            known = self._known[key] = Expression(op, dtype, args)
        return known


def _simpler(op: str, *args: Expression) -> Expression | None:
    match op, args:
        case "where", (_, chosen, other) if chosen is other:
            return chosen
        case "where", (condition, chosen, other) if condition.op == "constant":
            return chosen if condition.args[0] else other
        case "mul", (one, other) if _is(one, 1):
            return other
        case (("mul" | "div"), (other, one)) if _is(one, 1):
            return other
        # x + 0.0 is no x for x = -0.0, and neither is x - -0.0.
        case "add", (zero, other) if _is(zero, 0) and not zero.dtype.is_floating_point:
            return other
        case "add", (other, zero) if _is(zero, 0) and not zero.dtype.is_floating_point:
            return other
        case "sub", (other, zero) if _is(zero, 0) and copysign(1, zero.args[0]) > 0:
            return other
    return None


def _is(value: Expression, number: float) -> bool:
    return value.op == "constant" and value.dtype is not torch.bool and value.args[0] == number
