"""Arrays of scalar expressions, in which a large dimension is a family.

A dimension is either *explicit*, with an expression for each element, or it has *axes*. One
expression then stands for all its elements and depends on the axes, which are loop variables
(`Expression.axes`). A dimension with several axes was merged from several dimensions; its last axis
varies fastest. A leaf is one tensor of the step's flattened input TensorDicts.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from math import prod
from typing import Any, Self

import numpy as np
from torch import Tensor

from .errors import Unsupported
from .expressions import LARGE, Axis, Expression, Expressions, Place, Where

_MANY = 64
"""In a leaf with more elements than this, smaller dimensions get axes, too."""

_MOST_EXPLICIT = 2**14
"""The most expressions in one array."""

Values = np.ndarray[Any, Any]
Axes = tuple[Axis, ...]


@dataclass(frozen=True, eq=False)
class Array:
    """An array of expressions.

    Attributes:
        make: the factory of its expressions.
        values: the expressions, dtype object; the size is 1 along each dimension that has axes.
        axes: each dimension's axes; () for an explicit dimension.
    """

    make: Expressions
    values: Values
    axes: tuple[Axes, ...]

    @classmethod
    def of(cls, make: Expressions, values: Values) -> Self:
        """Return an array with all dimensions explicit."""
        return cls(make, values, ((),) * values.ndim)

    @classmethod
    def all(cls, make: Expressions, value: Expression, shape: Sequence[int]) -> "Array":
        """Return an array with the same value everywhere."""
        one = np.empty((1,) * len(shape), dtype=object)
        one[...] = value
        return cls(make, one, ((),) * len(shape)).expanded(shape)

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(
            prod(axis.size for axis in axes) if axes else size
            for axes, size in zip(self.axes, self.values.shape, strict=True)
        )

    @property
    def ndim(self) -> int:
        return self.values.ndim

    def each(self, function: Callable[[Expression], Expression]) -> "Array":
        """Apply a function to each expression."""
        return each(function, self)

    def transposed(self, dims: Sequence[int]) -> "Array":
        """Permute the dimensions."""
        axes = tuple(self.axes[dim] for dim in dims)
        return Array(self.make, self.values.transpose(dims), axes)

    def moved(self, dim: int, to: int) -> "Array":
        """Move one dimension to another position."""
        dims = [*range(self.ndim)]
        dims.insert(to % self.ndim, dims.pop(dim % self.ndim))
        return self.transposed(dims)

    def expanded(self, shape: Sequence[int]) -> "Array":
        """Broadcast to a shape; a new large dimension gets an axis on which no value depends."""
        missing = len(shape) - self.ndim
        values = self.values.reshape((1,) * missing + self.values.shape)
        axes = [*((),) * missing, *self.axes]
        explicit = []
        for dim, size in enumerate(shape):
            if not axes[dim] and values.shape[dim] == 1 and self.make.is_large(size):
                axes[dim] = (self.make.axis(size, "expanded", dim),)
            explicit.append(1 if axes[dim] else size)
        return Array(self.make, np.broadcast_to(values, explicit), tuple(axes))

    def reshaped(self, shape: Sequence[int]) -> "Array":
        """Reshape the array; it becomes explicit if its axes don't fit the new shape."""
        plan = _regrouped(self, shape)
        if plan is None:
            whole = self.explicit()
            return Array.of(self.make, whole.values.reshape(shape))
        return plan

    def explicit(self, *dims: int) -> "Array":
        """Make these dimensions explicit, or all if none are given.

        Raises:
            Unsupported: if that takes too many expressions.
        """
        array = self
        for dim in dims or range(self.ndim):
            if chain := array.axes[dim]:
                if prod(array.values.shape) * array.shape[dim] > _MOST_EXPLICIT:
                    raise Unsupported(f"too many elements to write out: {array.shape}")
                numbers = np.ndindex(*(axis.size for axis in chain))
                parts = [
                    _map(partial(_at, self.make, chain, place), array.values) for place in numbers
                ]
                axes = (*array.axes[:dim], (), *array.axes[dim % self.ndim + 1 :])
                array = Array(self.make, np.concatenate(parts, dim), axes)
        return array

    def along(self, dim: int, chain: Axes, *, rolled: bool = True) -> "Array":
        """Turn an explicit dimension into a family along axes.

        Args:
            dim: the dimension.
            chain: the axes.
            rolled: whether to look for one formula for all elements, which needs no memory.
        """
        values = np.moveaxis(self.values, dim, -1)
        for axis in chain[::-1]:
            rows = values.reshape(*values.shape[:-1], -1, axis.size)
            values = np.empty(rows.shape[:-1], dtype=object)
            for place in np.ndindex(*values.shape):
                values[place] = self.make.pack([*rows[place]], axis, rolled=rolled)
        axes = (*self.axes[:dim], chain, *self.axes[dim + 1 :])
        return Array(self.make, np.moveaxis(values, -1, dim), axes)

    def fold(self, dims: Sequence[int], op: str) -> "Array":
        """Reduce some dimensions to size 1 by a binary operation, element after element."""
        along = sorted(dim % self.ndim for dim in dims)
        kept = [dim for dim in range(self.ndim) if dim not in along]
        sizes = [self.values.shape[dim] for dim in kept]
        rows = self.values.transpose(*kept, *along).reshape(*sizes, -1)
        chain = [axis for dim in along for axis in self.axes[dim]]
        folded = np.empty(rows.shape[:-1], dtype=object)
        for place in np.ndindex(*folded.shape):
            value = rows[place][0]
            for other in rows[place][1:]:
                value = self.make(op, value.dtype, value, other)
            folded[place] = reduce(partial(self.make.fold, op), chain[::-1], value)
        axes = tuple(() if dim in along else self.axes[dim] for dim in range(self.ndim))
        return Array(self.make, np.expand_dims(folded, tuple(along)), axes)

    def elements(self) -> Iterator[tuple[Place, Expression]]:
        """Return each expression with its index in the flattened, row-major array."""
        steps = [prod(self.shape[dim + 1 :]) for dim in range(self.ndim)]
        for place in np.ndindex(*self.values.shape):
            base, strides = 0, []
            for dim, chain in enumerate(self.axes):
                base += place[dim] * steps[dim]
                step = steps[dim]
                for axis in chain[::-1]:
                    strides.append((axis, step))
                    step *= axis.size
            strides.sort(key=lambda item: item[0].number)
            value: Expression = self.values[tuple(place)]
            yield Place(base, tuple(strides)), value


def _map(function: Callable[..., Expression], *arrays: Values) -> Values:
    # For a zero-dimensional array, NumPy returns the bare element.
    return np.asarray(np.frompyfunc(function, len(arrays), 1)(*arrays), dtype=object)


def _at(make: Expressions, chain: Axes, place: Sequence[int], value: Expression) -> Expression:
    return make.at(value, dict(zip(chain, place, strict=True)))


def each(function: Callable[..., Expression], *arrays: Array) -> Array:
    """Broadcast arrays and apply a function of expressions element by element."""
    aligned = align(arrays)
    values = _map(function, *(array.values for array in aligned))
    return Array(aligned[0].make, values, aligned[0].axes)


def align(arrays: Sequence[Array]) -> list[Array]:
    """Broadcast arrays to the same dimensions with the same axes.

    If only some arrays have axes in a dimension, the others become families there. If they have
    different axes of the same sizes, all take the axes of one; arrays that are reduced or kept in
    memory come first in that choice. If the sizes differ, the dimension becomes explicit.
    """
    ndim = max(array.ndim for array in arrays)
    arrays = [
        Array(
            array.make,
            array.values.reshape((1,) * (ndim - array.ndim) + array.values.shape),
            ((),) * (ndim - array.ndim) + array.axes,
        )
        for array in arrays
    ]
    chosen: list[Axes] = []
    used = set[Axis]()
    for dim in range(ndim):
        chains = {array.axes[dim]: array for array in arrays[::-1] if array.axes[dim]}
        chain = min(chains, key=lambda chain: _preference(chains[chain], chain), default=())
        if len({tuple(axis.size for axis in other) for other in chains}) > 1:
            return align([array.explicit(dim) for array in arrays])
        if used.intersection(chain):  # an axis in two dimensions would mean the diagonal
            make = arrays[0].make
            chain = tuple(make.axis(axis.size, "beside", axis, dim) for axis in chain)
        used.update(chain)
        chosen.append(chain)
    return [_on(array, chosen) for array in arrays]


def _preference(array: Array, chain: Axes) -> tuple[bool, list[int]]:
    plain = all(value.plain or not value.axes.intersection(chain) for value in array.values.flat)
    return plain, [axis.number for axis in chain]


def _on(array: Array, chosen: Sequence[Axes]) -> Array:
    """Rewrite an array so that its dimensions have these axes."""
    where: dict[Axis, Axis | int] = {}
    for old, new in zip(array.axes, chosen, strict=True):
        where |= zip(old, new if old else (), strict=True)
    values = array.values
    if any(axis is not to for axis, to in where.items()):
        values = _map(lambda value: array.make.at(value, where), values)
    axes = tuple(new if old else () for old, new in zip(array.axes, chosen, strict=True))
    moved = Array(array.make, values, axes)
    for dim, chain in enumerate(chosen):
        if chain and not moved.axes[dim]:
            if moved.values.shape[dim] > 1:
                moved = moved.along(dim, chain)
            else:
                with_axes = (*moved.axes[:dim], chain, *moved.axes[dim + 1 :])
                moved = Array(array.make, moved.values, with_axes)
    return moved


def _regrouped(array: Array, shape: Sequence[int]) -> Array | None:
    """Reshape an array; None if a dimension's parts would have to be both split and merged."""
    sizes: list[int] = []  # one for each axis or explicit dimension
    axes: list[Axis | None] = []
    for size, chain in zip(array.values.shape, array.axes, strict=True):
        sizes += [axis.size for axis in chain] if chain else [size]
        axes += chain or [None]
    parts = [(size, axis) for size, axis in zip(sizes, axes, strict=True) if size > 1]
    # Parts are split if the new shape needs it; each new dimension is a list of parts.
    split: list[tuple[int, Axis | None]] = []
    substitutions: list[Where] = []
    dims: list[list[int]] = []
    for size in shape:
        left, mine = size, list[int]()
        while left > 1:
            if not parts:
                return None
            (first, axis), *rest = parts
            if left % first == 0:
                parts, taken = rest, first
            elif first % left == 0:
                within, taken = first // left, left
                inner = None
                if axis is not None:
                    inner = array.make.axis(within, "inner", axis)
                    outer = array.make.axis(left, "outer", axis)
                    substitutions.append({axis: _merged(outer, inner)})
                    axis = outer
                parts = [(within, inner), *rest]
            else:
                return None
            mine.append(len(split))
            split.append((taken, axis))
            left //= taken
        dims.append(mine)
    values = array.values
    for where in substitutions:
        values = _map(partial(array.make.at, where=where), values)
    bare = values.reshape([1 if axis else size for size, axis in split] or [])
    one = Array(array.make, bare, tuple((axis,) if axis else () for _, axis in split))
    rolled = all(value.op == "input" for value in array.values.flat)
    for mine in dims:  # an explicit part merged with an axis gets an axis, too
        if any(split[part][1] for part in mine):
            for part in mine:
                size, axis = split[part]
                if axis is None:
                    chain = (array.make.axis(size, "part", *shape, part),)
                    one = one.along(part, chain, rolled=rolled)
    values = one.values.reshape(
        [prod(one.values.shape[part] for part in mine) for mine in dims] or []
    )
    chains = tuple(tuple(axis for part in mine for axis in one.axes[part]) for mine in dims)
    return Array(array.make, values, chains)


def _merged(outer: Axis, inner: Axis) -> Place:
    """Return the index along the axis that two axes make together."""
    return Place(0, tuple(sorted({outer: inner.size, inner: 1}.items(), key=_number)))


def _number(stride: tuple[Axis, int]) -> int:
    return stride[0].number


def constants(tensor: Tensor, make: Expressions, *key: object) -> Array:
    """Return a constant tensor as an array; a large dimension becomes a table."""
    chains = tuple(
        (make.axis(size, "constant", *key, dim),) if make.is_large(size) else ()
        for dim, size in enumerate(tensor.shape)
    )
    numbers = tuple(tensor.flatten().tolist())
    return _leaf(make, tensor.shape, chains, lambda place: make.table(numbers, place, tensor.dtype))


def large_sizes(shapes: Iterable[Sequence[int]]) -> set[int]:
    """Return the sizes of the leaves' dimensions that get axes.

    In a leaf of many elements, the leading dimensions get axes until few elements are left.
    """
    sizes = set[int]()
    for shape in shapes:
        for dim, size in enumerate(shape):
            if size >= LARGE or (prod(shape) > _MANY and size > 2 and prod(shape[dim:]) > LARGE):
                sizes.add(size)
    return sizes


def inputs(tensor: Tensor, make: Expressions, leaf: int) -> Array:
    """Return a leaf's elements for two lanes, ``[..., 2]``; its large dimensions are families.

    Leaves of the same shape share their axes, such as a layer's weights and their traces.
    """
    shape = tensor.shape[:-1]
    chains: tuple[Axes, ...] = tuple(
        (make.axis(size, "leaf", *shape, dim),) if make.is_large(size) else ()
        for dim, size in enumerate(shape)
    )

    def of_lane(lane: int) -> Array:
        return _leaf(make, shape, chains, lambda place: make.input(leaf, place, lane, tensor.dtype))

    lanes = [of_lane(0), of_lane(1)]
    return Array(make, np.stack([lane.values for lane in lanes], -1), (*chains, ()))


def _leaf(
    make: Expressions,
    shape: Sequence[int],
    chains: tuple[Axes, ...],
    element: Callable[[Place], Expression],
) -> Array:
    values = np.empty(
        [1 if chain else size for size, chain in zip(shape, chains, strict=True)], dtype=object
    )
    places = Array(make, values, chains)
    for index, (place, _) in zip(np.ndindex(*values.shape), places.elements(), strict=True):
        values[index] = element(place)
    return places
