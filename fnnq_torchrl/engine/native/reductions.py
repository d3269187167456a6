"""Operations along dimensions."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import torch

from .executor import Array, Executor, each, operation
from .expressions import Unsupported

aten = torch.ops.aten


@operation(aten.sum, aten.prod)
def _sum(
    run: Executor,
    values: Array,
    dims: Sequence[int] | int | None = None,
    keepdim: bool = False,
    *,
    dtype: torch.dtype | None = None,
) -> Array:
    op = "add" if run.packet is aten.sum else "mul"
    along = [dims] if isinstance(dims, int) else dims or []
    return run.fold(run.cast(values, run.result.dtype), along, keepdim, op)


@operation(aten.mean)
def _mean(
    run: Executor,
    values: Array,
    dims: Sequence[int] | None = None,
    keepdim: bool = False,
    *,
    dtype: torch.dtype | None = None,
) -> Array:
    total = run.fold(run.cast(values, run.result.dtype), dims or [], keepdim, "add")
    return run.pointwise(total, values.size // max(total.size, 1), op="div")


@operation(aten.var, aten.var_mean)
def _var_mean(
    run: Executor,
    values: Array,
    dims: Sequence[int] | None = None,
    *,
    correction: float = 1,
    keepdim: bool = False,
) -> Any:
    mean = _mean(run, values, dims, True)
    deviation = run.pointwise(values, mean, op="sub")
    total = run.fold(run.pointwise(deviation, deviation, op="mul"), dims or [], keepdim, "add")
    number = values.size // max(mean.size, 1)
    variance = run.pointwise(total, number - correction, op="div")
    return variance if run.packet is aten.var else (variance, mean.reshape(total.shape))


@operation(aten.amax, aten.amin)
def _amax(run: Executor, values: Array, dims: Sequence[int] = (), keepdim: bool = False) -> Array:
    op = "maximum" if run.packet is aten.amax else "minimum"
    return run.fold(values, dims, keepdim, op)


@operation(aten.any)
def _any(
    run: Executor, values: Array, dims: Sequence[int] | int = (), keepdim: bool = False
) -> Array:
    dims = [dims] if isinstance(dims, int) else dims
    return run.fold(run.cast(values, torch.bool), dims, keepdim, "bitwise_or")


@operation(aten.linalg_vector_norm)
def _norm(
    run: Executor,
    values: Array,
    order: float = 2,
    dims: Sequence[int] | None = None,
    keepdim: bool = False,
) -> Array:
    if order != 2:
        raise Unsupported("no translation for norms that aren't Euclidean")
    squares = run.pointwise(values, values, op="mul")
    return run.pointwise(run.fold(squares, dims or [], keepdim, "add"), op="sqrt")


@operation(aten.argmax, aten.argmin)
def _argmax(run: Executor, values: Array, dim: int | None = None, keepdim: bool = False) -> Array:
    op = "gt" if run.packet is aten.argmax else "lt"
    rows = values.reshape(-1) if dim is None else np.moveaxis(values, dim, -1)
    return _extreme(run, rows, op)[1].reshape(run.result.shape)


@operation(aten.max, aten.min)
def _max(run: Executor, values: Array, dim: int | None = None, keepdim: bool = False) -> Any:
    largest = run.packet is aten.max
    if dim is None:
        return run.fold(values, [], False, "maximum" if largest else "minimum")
    both = _extreme(run, np.moveaxis(values, dim, -1), "gt" if largest else "lt")
    return tuple(array.reshape(run.result.shape) for array in both)


def _extreme(run: Executor, rows: Array, op: str) -> tuple[Array, Array]:
    """The first of the most extreme numbers of each row, and its place. None is beyond NaN."""
    make = run.make
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


@operation(aten.mm, aten.bmm)
def _matmul(run: Executor, left: Array, right: Array) -> Array:
    dtype = run.result.dtype
    products = each(partial(run.make, "mul", dtype), left[..., :, :, None], right[..., None, :, :])
    return run.fold(products, [-2], False, "add")
