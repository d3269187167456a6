"""Operations that move elements, pick them, or make them anew."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from .call import Array, Call, Operations, constants
from .expressions import Unsupported

aten = torch.ops.aten

OPERATIONS = Operations()


@OPERATIONS.register(aten.view, aten.reshape, aten._unsafe_view, aten.squeeze, aten.unsqueeze)
def _view(call: Call, values: Array, *_: Any) -> Array:
    return values.reshape(call.result.shape)


@OPERATIONS.register(aten.expand)
def _expand(call: Call, values: Array, *_: Any) -> Array:
    return np.broadcast_to(values, call.result.shape)


@OPERATIONS.register(aten.permute)
def _permute(call: Call, values: Array, dims: Sequence[int]) -> Array:
    return values.transpose(dims)


@OPERATIONS.register(aten.t)
def _t(call: Call, values: Array) -> Array:
    return values.T


@OPERATIONS.register(aten.transpose)
def _transpose(call: Call, values: Array, dim: int, other: int) -> Array:
    return values.swapaxes(dim, other)


@OPERATIONS.register(aten.select)
def _select(call: Call, values: Array, dim: int, index: int) -> Array:
    return np.asarray(np.moveaxis(values, dim, 0)[index], dtype=object)


@OPERATIONS.register(aten.slice)
def _slice(
    call: Call,
    values: Array,
    dim: int = 0,
    start: int | None = None,
    end: int | None = None,
    step: int = 1,
) -> Array:
    return np.moveaxis(np.moveaxis(values, dim, 0)[start:end:step], 0, dim)


@OPERATIONS.register(aten.flip)
def _flip(call: Call, values: Array, dims: Sequence[int]) -> Array:
    return np.flip(values, tuple(dims))


@OPERATIONS.register(aten.slice_scatter, aten.select_scatter)
def _put_back(call: Call, values: Array, part: Array, dim: int = 0, *where: int | None) -> Array:
    """What a slice or a selection would take is replaced."""
    changed = values.copy()
    place = where[0] if call.packet is aten.select_scatter else slice(*where)
    np.moveaxis(changed, dim, 0)[place] = (
        part if call.packet is aten.select_scatter else np.moveaxis(part, dim, 0)
    )
    return changed


@OPERATIONS.register(aten.cat)
def _cat(call: Call, arrays: Sequence[Array], dim: int = 0) -> Array:
    return np.concatenate([call.cast(array, call.result.dtype) for array in arrays], dim)


@OPERATIONS.register(aten.repeat)
def _repeat(call: Call, values: Array, times: Sequence[int]) -> Array:
    return np.tile(values, times)


@OPERATIONS.register(aten.constant_pad_nd)
def _pad(call: Call, values: Array, widths: Sequence[int], number: float = 0) -> Array:
    if min(widths) < 0:
        raise Unsupported("no translation for padding by less than nothing")
    pairs = [(0, 0)] * values.ndim
    for dim in range(len(widths) // 2):
        pairs[-1 - dim] = (widths[2 * dim], widths[2 * dim + 1])
    constant: Any = call.make.constant(number, call.result.dtype)
    return np.pad(values, pairs, constant_values=constant)


@OPERATIONS.register(aten.split_with_sizes)
def _split(call: Call, values: Array, sizes: Sequence[int], dim: int = 0) -> list[Array]:
    return np.split(values, np.cumsum(sizes)[:-1], dim)


@OPERATIONS.register(operator.getitem)
def _getitem(call: Call, values: Sequence[Array], index: int) -> Array:
    return values[index]


@OPERATIONS.register(aten.scalar_tensor, aten.full, aten.full_like)
def _full(call: Call, *args: Any, **_: Any) -> Array:
    return np.broadcast_to(call.cast(args[-1], call.result.dtype), call.result.shape)


@OPERATIONS.register(aten.arange)
def _arange(call: Call, *args: int, **_: Any) -> Array:
    return constants(torch.arange(*args, dtype=call.result.dtype), call.make)


@OPERATIONS.register(aten.index)
def _index(call: Call, values: Array, indices: Sequence[Array | None]) -> Array:
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
                picked[(*outer, *place, *inner)] = call.pick(choices, index[place])
    return picked


@OPERATIONS.register(aten.index_select)
def _index_select(call: Call, values: Array, dim: int, index: Array) -> Array:
    return _index(call, values, [*[None] * (dim % values.ndim), index])


@OPERATIONS.register(aten.gather)
def _gather(
    call: Call, values: Array, dim: int, index: Array, *, sparse_grad: bool = False
) -> Array:
    picked = np.empty(index.shape, dtype=object)
    rows = np.moveaxis(values, dim, -1)
    for place in np.ndindex(*index.shape):
        others = [*place]
        others.pop(dim)
        picked[place] = call.pick(rows[tuple(others)], index[place])
    return picked


@OPERATIONS.register(aten.scatter, aten.scatter_add)
def _scatter(call: Call, values: Array, dim: int, index: Array, source: Array | float) -> Array:
    dtype = call.result.dtype
    changed = values.copy()
    sources = call.cast(source, dtype)
    if not sources.ndim:
        sources = np.broadcast_to(sources, index.shape)
    dim %= max(values.ndim, 1)
    for place in np.ndindex(*index.shape):
        at: Any = index[place]
        for number in range(values.shape[dim]):
            there = (*place[:dim], number, *place[dim + 1 :])
            old: Any = changed[there]
            new: Any = sources[place]
            if call.packet is aten.scatter_add:
                new = call.make("add", dtype, old, new)
            this = call.make("eq", torch.bool, at, call.make.constant(number, at.dtype))
            changed[there] = call.make("where", dtype, this, new, old)
    return changed
