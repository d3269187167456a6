"""What one lane computes in a step: scalar expressions, each of them once."""

from typing import Any

import torch


class Unsupported(Exception):  # a verdict on the step, after which another engine runs it
    """The step has something that this compiler has no translation for."""


class Expression:
    """A number that a lane computes. Equal expressions are one object, so ``is`` compares them.

    Attributes:
        op: ``constant``, ``input``, or the operation (:mod:`fnnq_torchrl.native.source` has them).
        dtype: of the number.
        args: what it is computed from: expressions, but for ``constant`` (a Python number) and
            ``input`` (leaf and element) and ``lookup`` (a table of Python numbers first).
        operands: those of ``args`` that are expressions.
    """

    __slots__ = ("args", "dtype", "op", "operands")

    def __init__(self, op: str, dtype: torch.dtype, args: tuple[Any, ...]) -> None:
        self.op, self.dtype, self.args = op, dtype, args
        self.operands = [arg for arg in args if isinstance(arg, Expression)]


class Expressions:
    """Makes expressions, simplified where that changes no bit of any result.

    Args:
        most: how many different ones there may be.
    """

    def __init__(self, most: int) -> None:
        self._known: dict[tuple[Any, ...], Expression] = {}
        self._most = most

    def constant(self, value: float | bool, dtype: torch.dtype) -> Expression:
        """A number that is known beforehand."""
        if dtype is torch.bool:
            value = bool(value)
        elif not dtype.is_floating_point:
            value = int(value)
        else:
            value = torch.tensor(value, dtype=dtype).item()
        # The text tells 0.0 from -0.0, and one NaN from no other.
        return self._one("constant", dtype, (value,), key=repr(value))

    def input(self, leaf: int, element: int, dtype: torch.dtype) -> Expression:
        """An element of what a lane is given: ``leaf`` numbers the tensors."""
        return self._one("input", dtype, (leaf, element))

    def lookup(self, table: tuple[float, ...], index: Expression, dtype: torch.dtype) -> Expression:
        """The table's entry of that number."""
        return self._one("lookup", dtype, (table, index))

    def cast(self, value: Expression, dtype: torch.dtype) -> Expression:
        """The same number in another dtype."""
        if value.dtype is dtype:
            return value
        if value.op == "constant":
            return self.constant(value.args[0], dtype)
        return self._one("cast", dtype, (value,))

    def __call__(self, op: str, dtype: torch.dtype, *args: Expression) -> Expression:
        """The result of an operation."""
        if (simpler := self._simpler(op, *args)) is not None:
            return simpler
        return self._one(op, dtype, args)

    def _simpler(self, op: str, *args: Expression) -> Expression | None:
        def is_constant(arg: Expression, value: float) -> bool:
            return arg.op == "constant" and arg.args[0] == value

        match op, args:
            case "where", (_, chosen, other) if chosen is other:
                return chosen
            case "where", (condition, chosen, other) if condition.op == "constant":
                return chosen if condition.args[0] else other
            case "mul", (one, other) if is_constant(one, 1):
                return other
            case (("mul" | "div"), (other, one)) if is_constant(one, 1):
                return other
            # x + 0.0 is no x for x = -0.0.
            case "add", (zero, other) if is_constant(zero, 0) and not zero.dtype.is_floating_point:
                return other
            case "add", (other, zero) if is_constant(zero, 0) and not zero.dtype.is_floating_point:
                return other
            case "sub", (other, zero) if is_constant(zero, 0):
                return other
        return None

    def _one(
        self, op: str, dtype: torch.dtype, args: tuple[Any, ...], key: object = None
    ) -> Expression:
        key = (op, dtype, key if key is not None else args)
        if (known := self._known.get(key)) is None:
            if len(self._known) == self._most:
                raise Unsupported(f"more than {self._most:,} scalar operations")
            known = self._known[key] = Expression(op, dtype, args)
        return known
