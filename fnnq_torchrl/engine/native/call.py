"""Calls of torch's operations, carried out on arrays of scalar expressions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import torch

from .arrays import Array, each
from .expressions import Expression, Expressions

Operation = Callable[..., Any]
"""A function of a `Call` and the operation's own arguments, tensors as arrays of expressions."""


class Operations(dict[Any, Operation]):
    """The functions that carry operations out, by torch's operation (its overload packet)."""

    def register(self, *packets: Any) -> Callable[[Operation], Operation]:
        """Return a decorator that has a function carry these operations out."""

        def decorate(function: Operation) -> Operation:
            self.update(dict.fromkeys(packets, function))
            return function

        return decorate


@dataclass(frozen=True)
class Call:
    """One call of an operation, as torch has it, and the arithmetic to write it out with.

    Attributes:
        make: makes the expressions.
        packet: the operation.
        args: its arguments; tensors are torch's fake ones, which have a shape and a dtype.
        result: the fake tensor that it returns; the first one, if there are several.
    """

    make: Expressions
    packet: Any
    args: Sequence[Any]
    result: Any

    def cast(self, values: Array | float, dtype: torch.dtype) -> Array:
        """Return the same numbers in another dtype."""
        if not isinstance(values, Array):
            return Array.all(self.make, self.make.constant(values, dtype), ())
        return each(lambda value: self.make.cast(value, dtype), values)

    def pointwise(
        self, *operands: Array | float, op: str, computed_in: torch.dtype | None = None
    ) -> Array:
        """An operation on each element of what is broadcast, in the result's dtype by default."""
        dtype = self.result.dtype
        arrays = [self.cast(operand, computed_in or dtype) for operand in operands]
        return each(lambda *values: self.make(op, dtype, *values), *arrays)

    def fold(self, values: Array, dims: Sequence[int], keepdim: bool, op: str) -> Array:
        """All numbers along some dimensions, or along all, joined one after the other."""
        folded = values.fold(dims or range(values.ndim), op)
        return folded if keepdim else folded.reshaped(self.result.shape)

    def pick(self, choices: Sequence[Expression], index: Any) -> Expression:
        """Return the choice of that number; a negative one counts from the end."""
        dtype, size = self.result.dtype, len(choices)

        def number(value: int) -> Expression:
            return self.make.constant(value, index.dtype)

        if index.op == "constant":
            return choices[index.args[0] % size]
        below = self.make("lt", torch.bool, index, number(0))
        from_end = self.make("add", index.dtype, index, number(size))
        index = self.make("where", index.dtype, below, from_end, index)
        if all(choice.op == "constant" for choice in choices):
            # Nothing but the table is ever read, whatever a diverged run comes up with.
            index = self.make("maximum", index.dtype, index, number(0))
            index = self.make("minimum", index.dtype, index, number(size - 1))
            return self.make.lookup(tuple(choice.args[0] for choice in choices), index, dtype)
        picked = choices[0]
        for place, choice in enumerate(choices[1:], start=1):
            this = self.make("eq", torch.bool, index, number(place))
            picked = self.make("where", dtype, this, choice, picked)
        return picked
