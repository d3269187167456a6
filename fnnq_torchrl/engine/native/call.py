"""Calls of torch operations, interpreted on arrays of scalar expressions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import torch

from .arrays import Array, each
from .expressions import Expression, Expressions

Operation = Callable[..., Any]
"""A function of a `Call` and the operation's arguments, in which arrays stand for tensors."""


class Operations(dict[Any, Operation]):
    """The functions that interpret torch operations, by the operation's overload packet."""

    def register(self, *packets: Any) -> Callable[[Operation], Operation]:
        """Return a decorator that registers a function for these operations."""

        def decorate(function: Operation) -> Operation:
            self.update(dict.fromkeys(packets, function))
            return function

        return decorate


@dataclass(frozen=True)
class Call:
    """One call of an operation in the traced graph, with helpers to build its result.

    Attributes:
        make: the factory of expressions.
        packet: the operation's overload packet.
        args: the call's arguments; tensors are fake tensors, with a shape and a dtype only.
        result: the fake tensor that the call returns; the first, if it returns several.
    """

    make: Expressions
    packet: Any
    args: Sequence[Any]
    result: Any

    def cast(self, values: Array | float, dtype: torch.dtype) -> Array:
        """Convert values to another dtype."""
        if not isinstance(values, Array):
            return Array.all(self.make, self.make.constant(values, dtype), ())
        return each(lambda value: self.make.cast(value, dtype), values)

    def pointwise(
        self, *operands: Array | float, op: str, computed_in: torch.dtype | None = None
    ) -> Array:
        """Broadcast operands and apply an operation element by element.

        Args:
            *operands: arrays or numbers.
            op: the operation of `Expression.op`.
            computed_in: the operands' dtype; the result's, if not given.
        """
        dtype = self.result.dtype
        arrays = [self.cast(operand, computed_in or dtype) for operand in operands]
        return each(lambda *values: self.make(op, dtype, *values), *arrays)

    def fold(self, values: Array, dims: Sequence[int], keepdim: bool, op: str) -> Array:
        """Reduce dimensions, or all if ``dims`` is empty, by a binary operation."""
        folded = values.fold(dims or range(values.ndim), op)
        return folded if keepdim else folded.reshaped(self.result.shape)

    def pick(self, choices: Sequence[Expression], index: Any) -> Expression:
        """Return ``choices[index]``; a negative index counts from the end."""
        dtype, size = self.result.dtype, len(choices)

        def number(value: int) -> Expression:
            return self.make.constant(value, index.dtype)

        if index.op == "constant":
            return choices[index.args[0] % size]
        below = self.make("lt", torch.bool, index, number(0))
        from_end = self.make("add", index.dtype, index, number(size))
        index = self.make("where", index.dtype, below, from_end, index)
        if all(choice.op == "constant" for choice in choices):
            # The index is clamped: a diverged run must not read beyond the table.
            index = self.make("maximum", index.dtype, index, number(0))
            index = self.make("minimum", index.dtype, index, number(size - 1))
            return self.make.lookup(tuple(choice.args[0] for choice in choices), index, dtype)
        picked = choices[0]
        for place, choice in enumerate(choices[1:], start=1):
            this = self.make("eq", torch.bool, index, number(place))
            picked = self.make("where", dtype, this, choice, picked)
        return picked
