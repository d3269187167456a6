"""Operations along dimensions."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import torch

from .call import Array, Call, Operations, each
from .expressions import Unsupported

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
    return call.pointwise(total, values.size // max(total.size, 1), op="div")


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
    number = values.size // max(mean.size, 1)
    variance = call.pointwise(total, number - correction, op="div")
    return variance if call.packet is aten.var else (variance, mean.reshape(total.shape))


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
    op = "gt" if call.packet is aten.argmax else "lt"
    rows = values.reshape(-1) if dim is None else np.moveaxis(values, dim, -1)
    return _extreme(call, rows, op)[1].reshape(call.result.shape)


@OPERATIONS.register(aten.max, aten.min)
def _max(call: Call, values: Array, dim: int | None = None, keepdim: bool = False) -> Any:
    largest = call.packet is aten.max
    if dim is None:
        return call.fold(values, [], False, "maximum" if largest else "minimum")
    both = _extreme(call, np.moveaxis(values, dim, -1), "gt" if largest else "lt")
    return tuple(array.reshape(call.result.shape) for array in both)


def _extreme(call: Call, rows: Array, op: str) -> tuple[Array, Array]:
    """The first of the most extreme numbers of each row, and its place. None is beyond NaN."""
    make = call.make
    extremes = np.empty(rows.shape[:-1], dtype=object)
    places = np.empty(rows.shape[:-1], dtype=object)
    for row in np.ndindex(*places.shape):
        best: Any = rows[row][0]
        at = make.constant(0, torch.int64)
        for number, value in enumerate(rows[row][1:], start=1):
            better = make(op, torch.bool, value, best)
            if value.dtype.is_floating_point:
                first = make(
                    "bitwise_and",
                    torch.bool,
                    make("ne", torch.bool, value, value),
                    make("eq", torch.bool, best, best),
                )
                better = make("bitwise_or", torch.bool, better, first)
            best = make("where", value.dtype, better, value, best)
            at = make("where", torch.int64, better, make.constant(number, torch.int64), at)
        extremes[row], places[row] = best, at
    return extremes, places


@OPERATIONS.register(aten.mm, aten.bmm)
def _matmul(call: Call, left: Array, right: Array) -> Array:
    dtype = call.result.dtype
    products = each(partial(call.make, "mul", dtype), left[..., :, :, None], right[..., None, :, :])
    return call.fold(products, [-2], False, "add")
