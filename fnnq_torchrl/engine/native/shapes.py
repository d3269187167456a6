"""Operations that move elements, pick them, or make them anew."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from .executor import Array, Executor, operation
from .expressions import Unsupported

aten = torch.ops.aten


@operation(aten.view, aten.reshape, aten._unsafe_view, aten.squeeze, aten.unsqueeze)
def _view(run: Executor, values: Array, *_: Any) -> Array:
    return values.reshape(run.result.shape)


@operation(aten.expand)
def _expand(run: Executor, values: Array, *_: Any) -> Array:
    return np.broadcast_to(values, run.result.shape)


@operation(aten.permute)
def _permute(run: Executor, values: Array, dims: Sequence[int]) -> Array:
    return values.transpose(dims)


@operation(aten.t)
def _t(run: Executor, values: Array) -> Array:
    return values.T


@operation(aten.transpose)
def _transpose(run: Executor, values: Array, dim: int, other: int) -> Array:
    return values.swapaxes(dim, other)


@operation(aten.select)
def _select(run: Executor, values: Array, dim: int, index: int) -> Array:
    return np.asarray(np.moveaxis(values, dim, 0)[index], dtype=object)


@operation(aten.slice)
def _slice(
    run: Executor,
    values: Array,
    dim: int = 0,
    start: int | None = None,
    end: int | None = None,
    step: int = 1,
) -> Array:
    return np.moveaxis(np.moveaxis(values, dim, 0)[start:end:step], 0, dim)


@operation(aten.flip)
def _flip(run: Executor, values: Array, dims: Sequence[int]) -> Array:
    return np.flip(values, tuple(dims))


@operation(aten.slice_scatter, aten.select_scatter)
def _put_back(run: Executor, values: Array, part: Array, dim: int = 0, *where: int | None) -> Array:
    """What a slice or a selection would take is replaced."""
    changed = values.copy()
    place = where[0] if run.packet is aten.select_scatter else slice(*where)
    np.moveaxis(changed, dim, 0)[place] = (
        part if run.packet is aten.select_scatter else np.moveaxis(part, dim, 0)
    )
    return changed


@operation(aten.cat)
def _cat(run: Executor, arrays: Sequence[Array], dim: int = 0) -> Array:
    return np.concatenate([run.cast(array, run.result.dtype) for array in arrays], dim)


@operation(aten.repeat)
def _repeat(run: Executor, values: Array, times: Sequence[int]) -> Array:
    return np.tile(values, times)


@operation(aten.constant_pad_nd)
def _pad(run: Executor, values: Array, widths: Sequence[int], number: float = 0) -> Array:
    if min(widths) < 0:
        raise Unsupported("no translation for padding by less than nothing")
    pairs = [(0, 0)] * values.ndim
    for dim in range(len(widths) // 2):
        pairs[-1 - dim] = (widths[2 * dim], widths[2 * dim + 1])
    constant: Any = run.make.constant(number, run.result.dtype)
    return np.pad(values, pairs, constant_values=constant)


@operation(aten.split_with_sizes)
def _split(run: Executor, values: Array, sizes: Sequence[int], dim: int = 0) -> list[Array]:
    return np.split(values, np.cumsum(sizes)[:-1], dim)


@operation(operator.getitem)
def _getitem(run: Executor, values: Sequence[Array], index: int) -> Array:
    return values[index]


@operation(aten.scalar_tensor, aten.full, aten.full_like)
def _full(run: Executor, *args: Any, **_: Any) -> Array:
    return np.broadcast_to(run.cast(args[-1], run.result.dtype), run.result.shape)


@operation(aten.arange)
def _arange(run: Executor, *args: int, **_: Any) -> Array:
    return run.constants(torch.arange(*args, dtype=run.result.dtype))


@operation(aten.index)
def _index(run: Executor, values: Array, indices: Sequence[Array | None]) -> Array:
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


@operation(aten.index_select)
def _index_select(run: Executor, values: Array, dim: int, index: Array) -> Array:
    return _index(run, values, [*[None] * (dim % values.ndim), index])


@operation(aten.gather)
def _gather(
    run: Executor, values: Array, dim: int, index: Array, *, sparse_grad: bool = False
) -> Array:
    picked = np.empty(index.shape, dtype=object)
    rows = np.moveaxis(values, dim, -1)
    for place in np.ndindex(*index.shape):
        others = [*place]
        others.pop(dim)
        picked[place] = run.pick(rows[tuple(others)], index[place])
    return picked


@operation(aten.scatter, aten.scatter_add)
def _scatter(run: Executor, values: Array, dim: int, index: Array, source: Array | float) -> Array:
    dtype = run.result.dtype
    changed = values.copy()
    sources = run.cast(source, dtype)
    if not sources.ndim:
        sources = np.broadcast_to(sources, index.shape)
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
