"""Calls of torch's operations, carried out on arrays of scalar expressions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .expressions import Expression, Expressions

Array = np.ndarray[Any, Any]
"""An array of expressions."""

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
        if not isinstance(values, np.ndarray):
            return np.array(self.make.constant(values, dtype), dtype=object)
        return each(lambda value: self.make.cast(value, dtype), values)

    def pointwise(
        self, *operands: Array | float, op: str, computed_in: torch.dtype | None = None
    ) -> Array:
        """An operation on each element of what is broadcast, in the result's dtype by default."""
        dtype = self.result.dtype
        arrays = [self.cast(operand, computed_in or dtype) for operand in operands]
        return each(lambda *values: self.make(op, dtype, *values), *arrays)

    def fold(self, values: Array, dims: Sequence[int], keepdim: bool, op: str) -> Array:
        """All elements along some dimensions, or along all, joined one after the other."""
        along = sorted(dim % values.ndim for dim in dims) if dims else [*range(values.ndim)]
        kept = [dim for dim in range(values.ndim) if dim not in along]
        rows = values.transpose(*kept, *along).reshape(*(values.shape[dim] for dim in kept), -1)
        folded = np.empty(rows.shape[:-1], dtype=object)
        for place in np.ndindex(*folded.shape):
            folded[place] = reduce(partial(self.make, op, self.result.dtype), rows[place])
        return np.expand_dims(folded, tuple(along)) if keepdim else folded

    def pick(self, choices: Sequence[Expression], index: Any) -> Expression:
        """Return the choice of that number; a negative one counts from the end."""
        dtype, size = self.result.dtype, len(choices)

        def number(value: int) -> Expression:
            return self.make.constant(value, index.dtype)

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


def each(function: Callable[..., Expression], *arrays: Array) -> Array:
    """A function of expressions on each element of what is broadcast."""
    # Of arrays without dimensions NumPy makes the bare element.
    return np.asarray(np.frompyfunc(function, len(arrays), 1)(*arrays), dtype=object)


def constants(tensor: Tensor, make: Expressions) -> Array:
    """Return an array of the tensor's elements."""
    array = np.empty(tensor.shape, dtype=object)
    for place in np.ndindex(*tensor.shape):
        array[place] = make.constant(tensor[place].item(), tensor.dtype)
    return array
