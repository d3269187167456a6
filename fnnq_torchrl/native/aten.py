"""Torch's operations on what one lane holds, carried out on arrays of scalar expressions.

A step is traced for a single run, so its tensors are small and their elements are scalars.
Executing the trace on arrays of expressions writes the step out, element by element: views and
broadcasts are gone, and what is computed twice is found.

The operations are those of the core ATen set that a step is likely to have; composite ones come
decomposed (:mod:`fnnq_torchrl.graphs`).
"""

import operator
from collections.abc import Callable, Sequence
from functools import partial, reduce
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.fx import GraphModule, Interpreter, Node

from .expressions import Expression, Expressions, Unsupported
from .source import FUNCTIONS

aten = torch.ops.aten
Array = np.ndarray[Any, Any]
"""Of expressions."""
Operation = Callable[..., Any]

_OPERATIONS: dict[Any, Operation] = {}


def write_out(graph: GraphModule, inputs: Sequence[Array], make: Expressions) -> list[Array]:
    """The graph's outputs as expressions of its inputs.

    Args:
        graph: of core aten operations, traced for a single run.
        inputs: for each placeholder an array of expressions, of its shape.
        make: makes the expressions.

    Raises:
        Unsupported: there is an operation that isn't known here, or there are too many.
    """
    return [*_Executor(graph, make).run(*inputs)]


class _Executor(Interpreter):
    """Executes a graph on arrays of expressions."""

    def __init__(self, graph: GraphModule, make: Expressions) -> None:
        super().__init__(graph)
        self.make = make

    def run_node(self, n: Node) -> Any:
        value = n.meta.get("val")
        # What the result is like, its shape and dtype; the first one, if there are several.
        self.result: Any = value[0] if isinstance(value, tuple | list) else value
        self.likes: list[Any] = [
            arg.meta["val"] if isinstance(arg, Node) else arg for arg in n.args
        ]
        return super().run_node(n)

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
        return _each(lambda value: self.make.cast(value, dtype), values)

    def pointwise(
        self, *operands: Array | float, op: str, computed_in: torch.dtype | None = None
    ) -> Array:
        """An operation on each element of what is broadcast, in the result's dtype by default."""
        dtype = self.result.dtype
        arrays = [self.cast(operand, computed_in or dtype) for operand in operands]
        return _each(lambda *values: self.make(op, dtype, *values), *arrays)

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
        """The choice of that number."""
        dtype = self.result.dtype
        if all(choice.op == "constant" for choice in choices):
            return self.make.lookup(tuple(choice.args[0] for choice in choices), index, dtype)
        picked = choices[0]
        for number, choice in enumerate(choices[1:], start=1):
            this = self.make("eq", torch.bool, index, self.make.constant(number, index.dtype))
            picked = self.make("where", dtype, this, choice, picked)
        return picked


def _each(function: Callable[..., Expression], *arrays: Array) -> Array:
    # Of arrays without dimensions NumPy makes the bare element.
    return np.asarray(np.frompyfunc(function, len(arrays), 1)(*arrays), dtype=object)


def _operation(*packets: Any) -> Callable[[Operation], Operation]:
    def register(function: Operation) -> Operation:
        _OPERATIONS.update(dict.fromkeys(packets, function))
        return function

    return register


# -- each element on its own ----------------------------------------------------------------------

_ELEMENTARY = ("bitwise_and", "bitwise_not", "bitwise_or", "bitwise_xor", "maximum", "minimum")
for _name in (*FUNCTIONS, *_ELEMENTARY, "mul", "neg"):
    _OPERATIONS[getattr(aten, _name)] = partial(_Executor.pointwise, op=_name)
for _packet, _name in {
    aten.__lshift__: "lshift",
    aten.__rshift__: "rshift",
    aten.bitwise_left_shift: "lshift",
    aten.bitwise_right_shift: "rshift",
    aten.__and__: "bitwise_and",
    aten.__or__: "bitwise_or",
    aten.__xor__: "bitwise_xor",
    aten.logical_and: "bitwise_and",
    aten.logical_or: "bitwise_or",
    aten.logical_xor: "bitwise_xor",
    aten.logical_not: "bitwise_not",
}.items():
    _OPERATIONS[_packet] = partial(_Executor.pointwise, op=_name)


@_operation(aten.eq, aten.ne, aten.lt, aten.le, aten.gt, aten.ge)
def _compare(run: _Executor, left: Array, right: Array | float) -> Array:
    computed_in = torch.result_type(*run.likes)
    return run.pointwise(left, right, op=run.packet.__name__, computed_in=computed_in)


@_operation(aten.isnan)
def _isnan(run: _Executor, values: Array) -> Array:
    return run.pointwise(values, values, op="ne", computed_in=run.likes[0].dtype)


@_operation(aten.add, aten.sub)
def _add(run: _Executor, left: Array, right: Array | float, *, alpha: float = 1) -> Array:
    scaled = right if alpha == 1 else run.pointwise(right, alpha, op="mul")
    return run.pointwise(left, scaled, op=run.packet.__name__)


@_operation(aten.div)
def _div(
    run: _Executor, left: Array, right: Array | float, *, rounding_mode: str | None = None
) -> Array:
    if rounding_mode is None:
        return run.pointwise(left, right, op="div")
    if rounding_mode == "floor" or not run.result.dtype.is_floating_point:
        raise Unsupported("no translation for division with a rest")
    return run.pointwise(run.pointwise(left, right, op="div"), op="trunc")


@_operation(aten.remainder)
def _remainder(run: _Executor, left: Array | float, right: Array | float) -> Array:
    """With the sign of the divisor, as in Python."""
    if not run.result.dtype.is_floating_point:
        raise Unsupported("no translation for the division of whole numbers")
    quotient = run.pointwise(run.pointwise(left, right, op="div"), op="floor")
    rest = run.pointwise(left, run.pointwise(quotient, right, op="mul"), op="sub")
    # Where rounding has made the quotient too large by one.
    signs = run.pointwise(rest, right, op="mul")
    zero = run.make.constant(0, run.result.dtype)
    below = _each(lambda sign: run.make("lt", torch.bool, sign, zero), signs)
    return _where(run, below, run.pointwise(rest, right, op="add"), rest)


@_operation(aten.reciprocal)
def _reciprocal(run: _Executor, values: Array) -> Array:
    return run.pointwise(1, values, op="div")


@_operation(aten.rsqrt)
def _rsqrt(run: _Executor, values: Array) -> Array:
    return run.pointwise(1, run.pointwise(values, op="sqrt"), op="div")


@_operation(aten.sigmoid)
def _sigmoid(run: _Executor, values: Array) -> Array:
    negated = run.pointwise(run.pointwise(values, op="neg"), op="exp")
    return run.pointwise(1, run.pointwise(1, negated, op="add"), op="div")


@_operation(aten.sign)
def _sign(run: _Executor, values: Array) -> Array:
    dtype = run.result.dtype
    above, below = (
        _each(
            lambda value, op=op: run.make(op, torch.bool, value, run.make.constant(0, dtype)),
            values,
        )
        for op in ("gt", "lt")
    )
    return run.pointwise(above, below, op="sub")


@_operation(aten.relu)
def _relu(run: _Executor, values: Array) -> Array:
    return run.pointwise(values, 0, op="maximum")


@_operation(aten.pow)
def _pow(run: _Executor, base: Array | float, exponent: Array | float) -> Array:
    if isinstance(exponent, int | float):
        if exponent == 0.5:
            return run.pointwise(base, op="sqrt")
        if exponent == -1:
            return run.pointwise(1, base, op="div")
        if exponent in (2, 3):
            square = run.pointwise(base, base, op="mul")
            return square if exponent == 2 else run.pointwise(square, base, op="mul")
    if not run.result.dtype.is_floating_point:
        raise Unsupported("no translation for powers of whole numbers")
    return run.pointwise(base, exponent, op="pow")


@_operation(aten.clamp)
def _clamp(
    run: _Executor,
    values: Array,
    low: Array | float | None = None,
    high: Array | float | None = None,
) -> Array:
    if low is not None:
        values = run.pointwise(values, low, op="maximum")
    return values if high is None else run.pointwise(values, high, op="minimum")


@_operation(aten.where)
def _where(run: _Executor, mask: Array, chosen: Array | float, other: Array | float) -> Array:
    dtype = run.result.dtype
    return _each(
        lambda *values: run.make("where", dtype, *values),
        mask,
        run.cast(chosen, dtype),
        run.cast(other, dtype),
    )


@_operation(aten._to_copy)
def _to_copy(run: _Executor, values: Array, **_: Any) -> Array:
    return run.cast(values, run.result.dtype)


@_operation(aten.clone, aten.alias, aten.detach, aten.lift_fresh_copy)
def _clone(run: _Executor, values: Array, **_: Any) -> Array:
    return values


# -- along dimensions -----------------------------------------------------------------------------


@_operation(aten.sum, aten.prod)
def _sum(
    run: _Executor, values: Array, dims: Sequence[int] | int = (), keepdim: bool = False, **_: Any
) -> Array:
    op = "add" if run.packet is aten.sum else "mul"
    dims = [dims] if isinstance(dims, int) else dims or []
    return run.fold(run.cast(values, run.result.dtype), dims, keepdim, op)


@_operation(aten.mean)
def _mean(
    run: _Executor, values: Array, dims: Sequence[int] = (), keepdim: bool = False, **_: Any
) -> Array:
    total = run.fold(values, dims, keepdim, "add")
    return run.pointwise(total, values.size // max(total.size, 1), op="div")


@_operation(aten.var, aten.var_mean)
def _var_mean(
    run: _Executor,
    values: Array,
    dims: Sequence[int] | None = None,
    *,
    correction: float = 1,
    keepdim: bool = False,
) -> Any:
    mean = _mean(run, values, dims or (), True)
    deviation = run.pointwise(values, mean, op="sub")
    total = run.fold(run.pointwise(deviation, deviation, op="mul"), dims or (), keepdim, "add")
    number = values.size // max(mean.size, 1)
    variance = run.pointwise(total, number - correction, op="div")
    return variance if run.packet is aten.var else (variance, mean.reshape(total.shape))


@_operation(aten.amax, aten.amin)
def _amax(run: _Executor, values: Array, dims: Sequence[int] = (), keepdim: bool = False) -> Array:
    op = "maximum" if run.packet is aten.amax else "minimum"
    return run.fold(values, dims, keepdim, op)


@_operation(aten.any)
def _any(
    run: _Executor, values: Array, dims: Sequence[int] | int = (), keepdim: bool = False
) -> Array:
    dims = [dims] if isinstance(dims, int) else dims
    return run.fold(run.cast(values, torch.bool), dims, keepdim, "bitwise_or")


@_operation(aten.argmax)
def _argmax(run: _Executor, values: Array, dim: int | None = None, keepdim: bool = False) -> Array:
    rows = values.reshape(-1) if dim is None else np.moveaxis(values, dim, -1)
    places = np.empty(rows.shape[:-1], dtype=object)
    for place in np.ndindex(*places.shape):
        first, *others = rows[place]
        best, at = first, run.make.constant(0, torch.int64)
        for number, value in enumerate(others, start=1):
            better = run.make("gt", torch.bool, value, best)
            best = run.make("where", value.dtype, better, value, best)
            at = run.make("where", torch.int64, better, run.make.constant(number, torch.int64), at)
        places[place] = at
    return places.reshape(run.result.shape)


@_operation(aten.mm, aten.bmm)
def _matmul(run: _Executor, left: Array, right: Array) -> Array:
    dtype = run.result.dtype
    products = _each(partial(run.make, "mul", dtype), left[..., :, :, None], right[..., None, :, :])
    return run.fold(products, [-2], False, "add")


# -- other shapes ---------------------------------------------------------------------------------


@_operation(aten.view, aten.reshape, aten._unsafe_view, aten.squeeze, aten.unsqueeze)
def _view(run: _Executor, values: Array, *_: Any) -> Array:
    return values.reshape(run.result.shape)


@_operation(aten.expand)
def _expand(run: _Executor, values: Array, *_: Any) -> Array:
    return np.broadcast_to(values, run.result.shape)


@_operation(aten.permute)
def _permute(run: _Executor, values: Array, dims: Sequence[int]) -> Array:
    return values.transpose(dims)


@_operation(aten.t)
def _t(run: _Executor, values: Array) -> Array:
    return values.T


@_operation(aten.transpose)
def _transpose(run: _Executor, values: Array, dim: int, other: int) -> Array:
    return values.swapaxes(dim, other)


@_operation(aten.select)
def _select(run: _Executor, values: Array, dim: int, index: int) -> Array:
    return np.asarray(np.moveaxis(values, dim, 0)[index], dtype=object)


@_operation(aten.slice)
def _slice(
    run: _Executor,
    values: Array,
    dim: int = 0,
    start: int | None = None,
    end: int | None = None,
    step: int = 1,
) -> Array:
    return np.moveaxis(np.moveaxis(values, dim, 0)[start:end:step], 0, dim)


@_operation(aten.flip)
def _flip(run: _Executor, values: Array, dims: Sequence[int]) -> Array:
    return np.flip(values, tuple(dims))


@_operation(aten.slice_scatter, aten.select_scatter)
def _put_back(
    run: _Executor, values: Array, part: Array, dim: int = 0, *where: int | None
) -> Array:
    """What a slice or a selection would take is replaced."""
    changed = values.copy()
    place = where[0] if run.packet is aten.select_scatter else slice(*where)
    np.moveaxis(changed, dim, 0)[place] = (
        part if run.packet is aten.select_scatter else np.moveaxis(part, dim, 0)
    )
    return changed


@_operation(aten.cat)
def _cat(run: _Executor, arrays: Sequence[Array], dim: int = 0) -> Array:
    return np.concatenate([run.cast(array, run.result.dtype) for array in arrays], dim)


@_operation(aten.split_with_sizes)
def _split(run: _Executor, values: Array, sizes: Sequence[int], dim: int = 0) -> list[Array]:
    return np.split(values, np.cumsum(sizes)[:-1], dim)


@_operation(operator.getitem)
def _getitem(run: _Executor, values: Sequence[Array], index: int) -> Array:
    return values[index]


# -- made anew, or picked by what is computed -----------------------------------------------------


@_operation(aten.scalar_tensor, aten.full, aten.full_like)
def _full(run: _Executor, *args: Any, **_: Any) -> Array:
    return np.broadcast_to(run.cast(args[-1], run.result.dtype), run.result.shape)


@_operation(aten.arange)
def _arange(run: _Executor, *args: int, **_: Any) -> Array:
    return run.constants(torch.arange(*args, dtype=run.result.dtype))


@_operation(aten.index)
def _index(run: _Executor, values: Array, indices: Sequence[Array | None]) -> Array:
    along = [(dim, index) for dim, index in enumerate(indices) if index is not None]
    if len(along) != 1:
        raise Unsupported("no translation for several indices at once")
    ((dim, index),) = along
    rows = np.moveaxis(values, dim, -1)
    before, after = rows.shape[:dim], rows.shape[dim:-1]
    picked = np.empty((*before, *index.shape, *after), dtype=object)
    for outer in np.ndindex(*before):
        for place in np.ndindex(*index.shape):
            for inner in np.ndindex(*after):
                choices = rows[(*outer, *inner)]
                picked[(*outer, *place, *inner)] = run.pick(choices, index[place])
    return picked


@_operation(aten.gather)
def _gather(run: _Executor, values: Array, dim: int, index: Array, **_: Any) -> Array:
    picked = np.empty(index.shape, dtype=object)
    rows = np.moveaxis(values, dim, -1)
    for place in np.ndindex(*index.shape):
        others = [*place]
        others.pop(dim)
        picked[place] = run.pick(rows[tuple(others)], index[place])
    return picked


@_operation(aten.scatter, aten.scatter_add)
def _scatter(
    run: _Executor, values: Array, dim: int, index: Array, source: Array | float, **_: Any
) -> Array:
    dtype = run.result.dtype
    changed = values.copy()
    sources = np.broadcast_to(run.cast(source, dtype), index.shape)
    dim %= max(values.ndim, 1)
    for place in np.ndindex(*index.shape):
        at: Any = index[place]
        for number in range(values.shape[dim]):
            there = (*place[:dim], number, *place[dim + 1 :])
            old: Any = changed[there]
            new: Any = sources[place]
            if run.packet is aten.scatter_add:
                new = run.make("add", dtype, old, new)
            this = run.make("eq", torch.bool, at, run.make.constant(number, at.dtype))
            changed[there] = run.make("where", dtype, this, new, old)
    return changed
