"""Operations that move, index or create elements."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from .arrays import Array, Values, align, constants, each
from .call import Call, Operations
from .errors import Unsupported
from .expressions import Expression

aten = torch.ops.aten

OPERATIONS = Operations()


@OPERATIONS.register(aten.view, aten.reshape, aten._unsafe_view, aten.squeeze, aten.unsqueeze)
def _view(call: Call, values: Array, *_: Any) -> Array:
    return values.reshaped(call.result.shape)


@OPERATIONS.register(aten.expand)
def _expand(call: Call, values: Array, *_: Any) -> Array:
    return values.expanded(call.result.shape)


@OPERATIONS.register(aten.permute)
def _permute(call: Call, values: Array, dims: Sequence[int]) -> Array:
    return values.transposed(dims)


@OPERATIONS.register(aten.t)
def _t(call: Call, values: Array) -> Array:
    return values.transposed(range(values.ndim)[::-1])


@OPERATIONS.register(aten.transpose)
def _transpose(call: Call, values: Array, dim: int, other: int) -> Array:
    dims = [*range(values.ndim)]
    dims[dim], dims[other] = dims[other], dims[dim]
    return values.transposed(dims)


@OPERATIONS.register(aten.select)
def _select(call: Call, values: Array, dim: int, index: int) -> Array:
    return _explicitly(values, dim, lambda rows: rows[index : index % len(rows) + 1]).reshaped(
        call.result.shape
    )


@OPERATIONS.register(aten.slice)
def _slice(
    call: Call,
    values: Array,
    dim: int = 0,
    start: int | None = None,
    end: int | None = None,
    step: int = 1,
) -> Array:
    if call.result.shape == values.shape:
        return values
    return _explicitly(values, dim, lambda rows: rows[start:end:step])


@OPERATIONS.register(aten.flip)
def _flip(call: Call, values: Array, dims: Sequence[int]) -> Array:
    for dim in dims:
        values = _explicitly(values, dim, lambda rows: rows[::-1])
    return values


@OPERATIONS.register(aten.slice_scatter, aten.select_scatter)
def _put_back(call: Call, values: Array, part: Array, dim: int = 0, *where: int | None) -> Array:
    """Replace the elements that a slice or a selection would take."""
    if selected := call.packet is aten.select_scatter:
        at = dim % values.ndim
        part = part.reshaped([*part.shape[:at], 1, *part.shape[at:]])
    place = slice(*where) if not selected else where[0]
    rows, parts = _rows(values, dim), _rows(part, dim)
    places = np.atleast_1d(np.arange(len(rows))[place])
    for number, row in zip(places, parts, strict=True):
        rows[number] = row
    return _joined(rows, dim)


@OPERATIONS.register(aten.cat)
def _cat(call: Call, arrays: Sequence[Array], dim: int = 0) -> Array:
    cast = [call.cast(array, call.result.dtype) for array in arrays]
    return _joined([row for array in cast for row in _rows(array, dim)], dim)


@OPERATIONS.register(aten.repeat)
def _repeat(call: Call, values: Array, times: Sequence[int]) -> Array:
    array = values.reshaped([*[1] * (len(times) - values.ndim), *values.shape])
    for dim, number in enumerate(times):
        array = _joined(_rows(array, dim) * number, dim) if number > 1 else array
    return array


@OPERATIONS.register(aten.constant_pad_nd)
def _pad(call: Call, values: Array, widths: Sequence[int], number: float = 0) -> Array:
    if min(widths) < 0:
        raise Unsupported("no translation for padding by a negative width")
    constant = call.cast(number, call.result.dtype)
    for pair in range(len(widths) // 2):
        dim = values.ndim - 1 - pair
        edge = constant.expanded([*values.shape[:dim], 1, *values.shape[dim + 1 :]])
        before, after = ([edge] * width for width in widths[2 * pair : 2 * pair + 2])
        values = _joined([*before, *_rows(values, dim), *after], dim)
    return values


@OPERATIONS.register(aten.split_with_sizes)
def _split(call: Call, values: Array, sizes: Sequence[int], dim: int = 0) -> list[Array]:
    ends = np.cumsum(sizes)
    return [
        _explicitly(values, dim, lambda rows, end=end, size=size: rows[end - size : end])
        for end, size in zip(ends, sizes, strict=True)
    ]


@OPERATIONS.register(operator.getitem)
def _getitem(call: Call, values: Sequence[Array], index: int) -> Array:
    return values[index]


@OPERATIONS.register(aten.scalar_tensor, aten.full, aten.full_like)
def _full(call: Call, *args: Any, **_: Any) -> Array:
    return call.cast(args[-1], call.result.dtype).expanded(call.result.shape)


@OPERATIONS.register(aten.arange)
def _arange(call: Call, *args: int, **_: Any) -> Array:
    numbers = torch.arange(*args, dtype=call.result.dtype)
    return constants(numbers, call.make, "arange", *args)


@OPERATIONS.register(aten.index)
def _index(call: Call, values: Array, indices: Sequence[Array | None]) -> Array:
    along = [(dim, index) for dim, index in enumerate(indices) if index is not None]
    if len(along) != 1:
        raise Unsupported("no translation for several indices at once")
    ((dim, index),) = along
    # [before, *1, after, numbers] and [*1, index, *1, 1]
    others = [*values.shape[:dim], *[1] * index.ndim, *values.shape[dim + 1 :]]
    rows = values.moved(dim, -1).reshaped([*others, values.shape[dim]])
    after = values.ndim - dim - 1
    return _pick(call, rows, index.reshaped([*[1] * dim, *index.shape, *[1] * after, 1]))


@OPERATIONS.register(aten.index_select)
def _index_select(call: Call, values: Array, dim: int, index: Array) -> Array:
    return _index(call, values, [*[None] * (dim % values.ndim), index])


@OPERATIONS.register(aten.gather)
def _gather(
    call: Call, values: Array, dim: int, index: Array, *, sparse_grad: bool = False
) -> Array:
    dim %= max(values.ndim, 1)
    for other, size in enumerate(index.shape):
        if other != dim and values.shape[other] != size:
            values = _explicitly(values, other, lambda rows, size=size: rows[:size])
    # [others, numbers of values, 1] and [others, 1, numbers of index]
    rows, at = values.moved(dim, -1), index.moved(dim, -1)
    rows = rows.reshaped([*rows.shape[:-1], 1, rows.shape[-1]])
    picked = _pick(call, rows, at.reshaped([*at.shape, 1]))
    return picked.moved(-1, dim)


@OPERATIONS.register(aten.scatter, aten.scatter_add)
def _scatter(call: Call, values: Array, dim: int, index: Array, source: Array | float) -> Array:
    dtype, make = call.result.dtype, call.make
    sources = call.cast(source, dtype).expanded(index.shape)
    dim %= max(values.ndim, 1)
    for other in range(values.ndim):
        if other != dim and values.shape[other] != index.shape[other]:
            raise Unsupported("no translation for scattering into a part")
    shape = [values.shape[dim] if other == dim else 1 for other in range(values.ndim)]
    size = values.shape[dim]
    numbers = constants(torch.arange(size), make, "place", size).reshaped(shape)

    def put(old: Expression, new: Expression, at: Expression, number: Expression) -> Expression:
        if call.packet is aten.scatter_add:
            new = make("add", dtype, old, new)
        at = _narrow(call, at, size)
        here = make("eq", torch.bool, at, make.cast(number, at.dtype))
        return make("where", dtype, here, new, old)

    for at, new in zip(_rows(index, dim), _rows(sources, dim), strict=True):
        values = each(put, values, new, at, numbers)
    return values


def _narrow(call: Call, index: Expression, size: int) -> Expression:
    """Return an index as 32 bits, of which vectors hold more, if it was converted to 64 bits."""
    if index.op == "cast" and index.operands[0].dtype is not torch.bool and size < 2**31:
        return call.make.cast(index.operands[0], torch.int32)
    return index


def _pick(call: Call, rows: Array, index: Array) -> Array:
    """Index the last dimension.

    Args:
        rows: ``[..., numbers]``.
        index: ``[..., 1]``.

    Returns:
        The rows' numbers, ``[...]``.
    """
    if not rows.axes[-1]:
        columns = _rows(rows, -1)
        return _without_last(each(lambda at, *choices: call.pick(choices, at), index, *columns))
    make, size, chain = call.make, rows.shape[-1], rows.axes[-1]
    family = Array(make, rows.values, (*rows.axes[:-1], ()))

    def pick(values: Expression, at: Expression) -> Expression:
        def number(value: int) -> Expression:
            return make.constant(value, at.dtype)

        if at.op == "constant":
            places = np.unravel_index(at.args[0] % size, [axis.size for axis in chain])
            return make.at(values, dict(zip(chain, map(int, places), strict=True)))
        at = _narrow(call, at, size)
        below = make("lt", torch.bool, at, number(0))
        at = make("where", at.dtype, below, make("add", at.dtype, at, number(size)), at)
        at = make("minimum", at.dtype, make("maximum", at.dtype, at, number(0)), number(size - 1))
        return make.pick(values, chain, at)

    return _without_last(each(pick, family, index))


def _without_last(array: Array) -> Array:
    return Array(array.make, array.values[..., 0], array.axes[:-1])


def _explicitly(values: Array, dim: int, function: Any) -> Array:
    """Make a dimension explicit and apply a function that selects or orders its elements."""
    array = values.explicit(dim)
    rows: Values = np.moveaxis(function(np.moveaxis(array.values, dim, 0)), 0, dim)
    return Array(array.make, rows, array.axes)


def _rows(values: Array, dim: int) -> list[Array]:
    """Split an array along a dimension into slices of size 1."""
    array = values.explicit(dim)
    return [
        Array(array.make, rows, array.axes)
        for rows in np.split(array.values, array.values.shape[dim], dim)
    ]


def _joined(rows: Sequence[Array], dim: int) -> Array:
    aligned = align(rows)
    values = np.concatenate([row.values for row in aligned], dim)
    return Array(aligned[0].make, values, aligned[0].axes)
