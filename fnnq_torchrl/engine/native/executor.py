"""A traced step, carried out on arrays of scalar expressions: the step is written out.

Views and broadcasts are gone then, and what is computed twice is found. The operations are those of
the core ATen set that a step is likely to have; composite ones come decomposed
(:mod:`fnnq_torchrl.engine.graphs`).
"""

from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.fx import GraphModule, Interpreter, Node

from .expressions import Expression, Expressions, Unsupported

Array = np.ndarray[Any, Any]
"""Of expressions."""

Operation = Callable[..., Any]

_OPERATIONS: dict[Any, Operation] = {}


def operation(*packets: Any) -> Callable[[Operation], Operation]:
    """Registers what carries operations out: a function of the executor and their arguments."""

    def register(function: Operation) -> Operation:
        _OPERATIONS.update(dict.fromkeys(packets, function))
        return function

    return register


class Executor(Interpreter):
    """Executes a graph of core aten operations on arrays of expressions.

    Args:
        graph: whose nodes know what their results are like.
        make: makes the expressions.
    """

    def __init__(self, graph: GraphModule, make: Expressions) -> None:
        super().__init__(graph)
        self.make = make

    def run_node(self, n: Node) -> Any:
        if n.op in ("placeholder", "output"):
            return super().run_node(n)
        value = n.meta.get("val")
        # What the result is like, its shape and dtype; the first one, if there are several.
        self.result: Any = value[0] if isinstance(value, tuple | list) else value
        self.likes: list[Any] = [
            arg.meta["val"] if isinstance(arg, Node) else arg for arg in n.args
        ]
        try:
            result = super().run_node(n)
            _check(result, value)
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            raise Unsupported(f"no translation for {n.target} as it is called here") from error
        return result

    def get_attr(self, target: Any, args: Any, kwargs: Any) -> Array:
        return self.constants(super().get_attr(target, args, kwargs))

    def call_function(self, target: Any, args: Any, kwargs: Any) -> Any:
        self.packet = getattr(target, "overloadpacket", target)
        if self.packet not in _OPERATIONS:
            raise Unsupported(f"no translation for {target}")
        return _OPERATIONS[self.packet](self, *args, **kwargs)

    def constants(self, tensor: Tensor) -> Array:
        """An array of the tensor's elements."""
        array = np.empty(tensor.shape, dtype=object)
        for place in np.ndindex(*tensor.shape):
            array[place] = self.make.constant(tensor[place].item(), tensor.dtype)
        return array

    def cast(self, values: Array | float, dtype: torch.dtype) -> Array:
        """The same numbers in another dtype."""
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
        """The choice of that number; a negative one counts from the end."""
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


def _check(result: Any, like: Any) -> None:
    """Whether a result has the shape and the dtype that torch has for it.

    Raises:
        ValueError: it hasn't.
    """
    if isinstance(like, tuple | list):
        for one, like_one in zip(result, like, strict=True):
            _check(one, like_one)
    elif like is not None and (
        result.shape != tuple(like.shape)
        or any(value.dtype is not like.dtype for value in result.flat)
    ):
        raise ValueError(f"{result.shape} for {like}")
