"""Operations that reduce dimensions."""

from collections.abc import Sequence
from functools import partial
from math import prod
from typing import Any

import torch

from .arrays import Array, constants, each
from .call import Call, Operations
from .errors import Unsupported
from .expressions import Expression

aten = torch.ops.aten

OPERATIONS = Operations()


@OPERATIONS.register(aten.sum, aten.prod)
def _sum(
    call: Call,
    values: Array,
    dims: Sequence[int] | int | None = None,
    keepdim: bool = False,
    *,
    dtype: torch.dtype | None = None,
) -> Array:
    op = "add" if call.packet is aten.sum else "mul"
    along = [dims] if isinstance(dims, int) else dims or []
    return call.fold(call.cast(values, call.result.dtype), along, keepdim, op)


@OPERATIONS.register(aten.mean)
def _mean(
    call: Call,
    values: Array,
    dims: Sequence[int] | None = None,
    keepdim: bool = False,
    *,
    dtype: torch.dtype | None = None,
) -> Array:
    total = call.fold(call.cast(values, call.result.dtype), dims or [], keepdim, "add")
    return call.pointwise(total, prod(values.shape) // max(prod(total.shape), 1), op="div")


@OPERATIONS.register(aten.var, aten.var_mean)
def _var_mean(
    call: Call,
    values: Array,
    dims: Sequence[int] | None = None,
    *,
    correction: float = 1,
    keepdim: bool = False,
) -> Any:
    mean = _mean(call, values, dims, True)
    deviation = call.pointwise(values, mean, op="sub")
    total = call.fold(call.pointwise(deviation, deviation, op="mul"), dims or [], keepdim, "add")
    number = prod(values.shape) // max(prod(mean.shape), 1)
    variance = call.pointwise(total, number - correction, op="div")
    return variance if call.packet is aten.var else (variance, mean.reshaped(total.shape))


@OPERATIONS.register(aten.amax, aten.amin)
def _amax(call: Call, values: Array, dims: Sequence[int] = (), keepdim: bool = False) -> Array:
    op = "maximum" if call.packet is aten.amax else "minimum"
    return call.fold(values, dims, keepdim, op)


@OPERATIONS.register(aten.any)
def _any(call: Call, values: Array, dims: Sequence[int] | int = (), keepdim: bool = False) -> Array:
    dims = [dims] if isinstance(dims, int) else dims
    return call.fold(call.cast(values, torch.bool), dims, keepdim, "bitwise_or")


@OPERATIONS.register(aten.linalg_vector_norm)
def _norm(
    call: Call,
    values: Array,
    order: float = 2,
    dims: Sequence[int] | None = None,
    keepdim: bool = False,
) -> Array:
    if order != 2:
        raise Unsupported("no translation for norms that aren't Euclidean")
    squares = call.pointwise(values, values, op="mul")
    return call.pointwise(call.fold(squares, dims or [], keepdim, "add"), op="sqrt")


@OPERATIONS.register(aten.argmax, aten.argmin)
def _argmax(call: Call, values: Array, dim: int | None = None, keepdim: bool = False) -> Array:
    rows, dim = (values.reshaped([prod(values.shape)]), 0) if dim is None else (values, dim)
    return _extreme(call, rows, dim, call.packet is aten.argmax)[1].reshaped(call.result.shape)


@OPERATIONS.register(aten.max, aten.min)
def _max(call: Call, values: Array, dim: int | None = None, keepdim: bool = False) -> Any:
    largest = call.packet is aten.max
    if dim is None:
        return call.fold(values, [], False, "maximum" if largest else "minimum")
    both = _extreme(call, values, dim, largest)
    return tuple(array.reshaped(call.result.shape) for array in both)


def _extreme(call: Call, values: Array, dim: int, largest: bool) -> tuple[Array, Array]:
    """Return the largest or smallest number along a dimension and its first index; NaN wins."""
    make = call.make
    extreme = values.fold([dim], "maximum" if largest else "minimum")

    def found(value: Expression, best: Expression) -> Expression:
        same = make("eq", torch.bool, value, best)
        if not value.dtype.is_floating_point:
            return same
        return make("bitwise_or", torch.bool, same, make("ne", torch.bool, value, value))

    size = values.shape[dim]
    shape = [size if other == dim % values.ndim else 1 for other in range(values.ndim)]
    numbers = constants(torch.arange(size), make, "place", size).reshaped(shape)
    last = make.constant(size - 1, torch.int64)
    places = each(
        lambda here, number: make("where", torch.int64, here, number, last),
        each(found, values, extreme),
        numbers,
    )
    return extreme, places.fold([dim], "minimum")


@OPERATIONS.register(aten.mm, aten.bmm)
def _matmul(call: Call, left: Array, right: Array) -> Array:
    dtype = call.result.dtype
    rows = left.reshaped([*left.shape, 1])
    columns = right.reshaped([*right.shape[:-2], 1, *right.shape[-2:]])
    return call.fold(each(partial(call.make, "mul", dtype), rows, columns), [-2], False, "add")
