"""Symbolic scalar expressions, which describe what one lane computes in a step.

A lane is the place of one run in a batch; a leaf is one tensor of the step's flattened inputs.
Equal expressions are one object. An expression that depends on axes (loop variables) is a family:
it stands for a number at each value of its axes. With the axes i and j, ``input(leaf, 64·i + j)``
is all the weights of a layer. An operation on a large tensor is then a single expression, which the
program computes in loops.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import partial, reduce
from math import copysign, isnan
from typing import Any

import torch

from .errors import Unsupported

DTYPES = (torch.float32, torch.float64, torch.int32, torch.int64, torch.bool)

COMPARISONS = ("eq", "ne", "lt", "le", "gt", "ge")
_OF_BOOLEANS = {
    "add": "bitwise_or",
    "mul": "bitwise_and",
    "maximum": "bitwise_or",
    "minimum": "bitwise_and",
}
_PLAIN = {name: name for name in ("ceil", "floor", "fmod", "sqrt", "trunc")}
_PLAIN |= {"abs": "fabs", "round": "rint"}
VECTORISED = {"acos", "asin", "atan", "atan2", "cos", "cosh", "erf", "exp", "expm1", "log"}
VECTORISED |= {"log1p", "pow", "sin", "sinh", "tan", "tanh"}
FUNCTIONS = _PLAIN | {name: name for name in VECTORISED}
"""The C library's functions, by torch's names."""

_EXACT = ("abs", "add", "ceil", "div", "floor", "mul", "neg", "sub")
"""Operations that are rounded the same everywhere, so those of constants are computed at once."""

LARGE = 24
"""A dimension of at least this size is a family."""

WHOLE = ("at", "fold", "pack", "pick")
"""Operations that need several numbers of a family, or put several together to one."""


class Axis:
    """A loop's variable, from 0 to ``size - 1``. Axes are compared by ``is``."""

    __slots__ = ("number", "size")

    def __init__(self, number: int, size: int) -> None:
        self.number, self.size = number, size


@dataclass(frozen=True)
class Place:
    """An index that depends on axes: ``base + Σ stride · axis``."""

    base: int
    strides: tuple[tuple[Axis, int], ...] = ()

    def at(self, where: "Where") -> "Place":
        """Substitute axes in the index."""
        base, strides = self.base, dict[Axis, int]()
        for axis, stride in self.strides:
            target = _as_place(where.get(axis, axis))
            base += stride * target.base
            for of, step in target.strides:
                strides[of] = strides.get(of, 0) + stride * step
        return Place(base, tuple(sorted(strides.items(), key=lambda item: item[0].number)))


Target = Axis | Place | int

Where = Mapping[Axis, Target]
"""A substitution: for each axis, another axis, an index or one value of it."""


def _as_place(target: Target) -> Place:
    if isinstance(target, Axis):
        return Place(0, ((target, 1),))
    return target if isinstance(target, Place) else Place(target)


def axes_of(target: Target) -> frozenset[Axis]:
    """Return the axes that the target of a substitution depends on."""
    return frozenset(axis for axis, _ in _as_place(target).strides)


def moved(target: Target, where: Where) -> Target:
    """Substitute axes in the target of a substitution."""
    return target.at(where) if isinstance(target, Place) else where.get(target, target)  # type: ignore[arg-type]


class Expression:
    """A number that a lane computes. Equal expressions are one object, so ``is`` compares them.

    Attributes:
        op: ``constant``, ``input``, ``table``, one of :data:`WHOLE`, or an operation on each
            number (:mod:`.source` has them).
        dtype: the number's dtype.
        args: the operands; for these operations: ``constant`` (a Python number), ``input`` (leaf,
            place, lane), ``table`` (Python numbers, place), ``lookup`` (Python numbers, index),
            ``fold`` (operation, axis, operand), ``at`` (operand, substitution of its axes),
            ``pack`` (axis, a number for each of its values), ``pick`` (operand, axes, index).
        operands: the expressions among ``args``.
        axes: the axes that it depends on.
        plain: true if neither it nor any operand that depends on axes has an operation of
            :data:`WHOLE`.
    """

    __slots__ = ("args", "axes", "dtype", "op", "operands", "plain")

    operands: list["Expression"]

    def __init__(
        self, op: str, dtype: torch.dtype, args: tuple[Any, ...], axes: frozenset[Axis]
    ) -> None:
        self.op, self.dtype, self.args, self.axes = op, dtype, args, axes
        self.operands = [arg for arg in args if isinstance(arg, Expression)]
        alone = op not in WHOLE and all(operand.plain for operand in self.operands)
        self.plain: bool = alone or not axes


def in_order(results: Iterable[Expression]) -> list[Expression]:
    """Return results and all that they are computed from, each expression after its operands."""
    order: dict[Expression, None] = {}
    stack = [*results][::-1]
    while stack:
        waiting = [operand for operand in stack[-1].operands if operand not in order]
        if waiting:
            stack += waiting[::-1]
        else:
            order.setdefault(stack.pop())
    return [*order]


class Expressions:
    """A factory of expressions, with simplifications that leave every result bit for bit the same.

    Args:
        most: the most different expressions.
        large: further sizes of dimensions that get axes, besides those of at least :data:`LARGE`.
    """

    def __init__(self, most: int, large: Set[int] = frozenset()) -> None:
        self._known: dict[tuple[Any, ...], Expression] = {}
        self._axes: dict[tuple[Any, ...], Axis] = {}
        self._most, self._large = most, large
        self._moved: dict[tuple[Expression, frozenset[tuple[Axis, Target]]], Expression] = {}
        self._families: dict[tuple[Axis, tuple[Expression, ...]], Expression | None] = {}

    def is_large(self, size: int) -> bool:
        """Return whether a dimension of a size is a family rather than explicit."""
        return size >= LARGE or size in self._large

    def axis(self, size: int, *key: object) -> Axis:
        """Return the axis for a size and a key; equal keys get the same axis."""
        return self._axes.setdefault((size, *key), Axis(len(self._axes), size))

    def constant(self, value: float | bool, dtype: torch.dtype) -> Expression:
        """Return a constant, rounded or wrapped to its dtype."""
        if dtype is torch.bool:
            value = bool(value)
        elif dtype in (torch.int32, torch.int64):
            half = 1 << (8 * dtype.itemsize - 1)
            value = (int(value) + half) % (2 * half) - half
        else:
            value = torch.tensor(value, dtype=dtype).item()
        # By its text, 0.0 differs from -0.0, and NaN equals NaN.
        return self._one("constant", dtype, (value,), key=repr(value))

    def input(self, leaf: int, place: Place | int, lane: int, dtype: torch.dtype) -> Expression:
        """Return an element of an input tensor, the leaf with this number."""
        place = Place(place) if isinstance(place, int) else place
        axes = frozenset(axis for axis, _ in place.strides)
        return self._one("input", dtype, (leaf, place, lane), axes=axes)

    def table(self, numbers: tuple[float, ...], place: Place, dtype: torch.dtype) -> Expression:
        """Return the entry of a constant table at a place."""
        if not place.strides or all(repr(number) == repr(numbers[0]) for number in numbers):
            return self.constant(numbers[place.base], dtype)
        axes = frozenset(axis for axis, _ in place.strides)
        key = (repr(numbers), place)
        return self._one("table", dtype, (numbers, place), key, axes)

    def lookup(self, table: tuple[float, ...], index: Expression, dtype: torch.dtype) -> Expression:
        """Return the table's entry at a computed index, which must be within the table."""
        return self._one("lookup", dtype, (table, index), key=(repr(table), index))

    def cast(self, value: Expression, dtype: torch.dtype) -> Expression:
        """Convert a number to another dtype."""
        if value.dtype is dtype:
            return value
        if value.op == "constant" and value.args[0] == value.args[0]:
            return self.constant(value.args[0], dtype)
        if value.op == "table" and not value.dtype.is_floating_point:
            numbers, place = value.args
            return self.table(tuple(self.constant(n, dtype).args[0] for n in numbers), place, dtype)
        return self._one("cast", dtype, (value,))

    def fold(self, op: str, values: Expression, axis: Axis) -> Expression:
        """Reduce a family along an axis by a binary operation, in the order of the axis."""
        if values.dtype is torch.bool:
            op = _OF_BOOLEANS.get(op, op)
        if values.op == "pack" and values.args[0] is axis:
            return reduce(partial(self, op, values.dtype), values.args[1:])
        return self._one("fold", values.dtype, (op, axis, values), axes=values.axes - {axis})

    def pick(self, values: Expression, chain: tuple[Axis, ...], index: Expression) -> Expression:
        """Return the family's number at an index, which may differ by lane and must be in range.

        Args:
            values: the family.
            chain: the axes of the index, of which the last varies fastest.
            index: a whole number.

        Raises:
            Unsupported: if the family depends on some of several axes only.
        """
        if values.axes.isdisjoint(chain):
            return values
        if not values.axes.issuperset(chain):
            raise Unsupported("no translation for an index into a dimension of equal rows")
        if values.op == "table" and values.axes == {*chain} and len(chain) == 1:
            numbers, place = values.args
            (stride,) = (step for _, step in place.strides)
            return self.lookup(numbers[place.base :: stride][: chain[0].size], index, values.dtype)
        if values.op == "table":  # makes it an array, which each lane can index by itself
            values = self("copy", values.dtype, values)
        axes = (values.axes - {*chain}) | index.axes
        return self._one("pick", values.dtype, (values, chain, index), axes=axes)

    def at(self, value: Expression, where: Where) -> Expression:
        """Substitute axes in an expression, all at once."""
        where = {axis: to for axis, to in where.items() if axis in value.axes and axis is not to}
        if not where:
            return value
        if value.op == "input":
            leaf, place, lane = value.args
            return self.input(leaf, place.at(where), lane, value.dtype)
        if value.op == "table":
            numbers, place = value.args
            return self.table(numbers, place.at(where), value.dtype)
        if value.op == "at":
            inner, before = value.args
            now = {axis: moved(to, where) for axis, to in before}
            return self.at(inner, {**{axis: where.get(axis, axis) for axis in inner.axes}, **now})
        if value.op == "pack" and isinstance(number := where.get(value.args[0]), int):
            return self.at(value.args[1 + number], where)
        if value.plain and not any(isinstance(to, int) for to in where.values()):
            key = value, frozenset(where.items())
            if key not in self._moved:
                operands = [self.at(operand, where) for operand in value.operands]
                self._moved[key] = self._with(value, operands)
            return self._moved[key]
        axes = frozenset[Axis]().union(*(axes_of(where.get(axis, axis)) for axis in value.axes))
        moves = tuple(sorted(where.items(), key=lambda item: item[0].number))
        return self._one("at", value.dtype, (value, moves), axes=axes)

    def pack(self, values: Sequence[Expression], axis: Axis, *, rolled: bool = True) -> Expression:
        """Return the family that has given numbers along an axis.

        Args:
            values: one number for each value of the axis.
            axis: the axis.
            rolled: whether to look for one formula for all numbers, which needs no memory.
        """
        if rolled and (family := self._rolled(values, axis)) is not None:
            return family
        axes = frozenset[Axis]().union(*(value.axes for value in values)) | {axis}
        return self._one("pack", values[0].dtype, (axis, *values), axes=axes)

    def __call__(self, op: str, dtype: torch.dtype, *args: Expression) -> Expression:
        """Return the result of an operation, simplified."""
        if all(arg.dtype is torch.bool for arg in args):
            if op in COMPARISONS:  # compares them as 0 and 1: a C++ mask is 0 or -1
                args = tuple(self.cast(arg, torch.int32) for arg in args)
            op = _OF_BOOLEANS.get(op, op)
        if (simpler := _simpler(op, *args)) is not None:
            return simpler
        if op in _EXACT and all(arg.op == "constant" for arg in args):
            numbers = [torch.tensor(arg.args[0], dtype=arg.dtype) for arg in args]
            number = getattr(torch, op)(*numbers).item()
            if all(_is_normal(one) for one in (number, *(arg.args[0] for arg in args))):
                return self.constant(number, dtype)
        return self._one(op, dtype, args)

    def _rolled(self, values: Sequence[Expression], axis: Axis) -> Expression | None:
        """Find one formula in terms of the axis for all these values; None if there is none."""
        key = axis, tuple(values)
        if key not in self._families:
            self._families[key] = self._roll(values, axis)
        return self._families[key]

    def _roll(self, values: Sequence[Expression], axis: Axis) -> Expression | None:
        first = values[0]
        if all(value is first for value in values):
            return first
        if any(
            value.op != first.op
            or value.dtype is not first.dtype
            or len(value.operands) != len(first.operands)
            for value in values
        ):
            return None
        if first.op == "constant":
            numbers = tuple(value.args[0] for value in values)
            return self.table(numbers, Place(0, ((axis, 1),)), first.dtype)
        if first.op == "input":
            return _along(
                [value.args[1] for value in values],
                [(value.args[0], value.args[2]) for value in values],
                axis,
                lambda place: self.input(first.args[0], place, first.args[2], first.dtype),
            )
        if first.op == "table":
            return _along(
                [value.args[1] for value in values],
                [repr(value.args[0]) for value in values],
                axis,
                lambda place: self.table(first.args[0], place, first.dtype),
            )
        if first.op == "at":
            return self._unrolled(values, axis)
        if first.op in WHOLE or (first.op == "lookup" and len({v.args[0] for v in values}) > 1):
            return None
        operands = []
        for column in zip(*(value.operands for value in values), strict=True):
            if (rolled := self._rolled(column, axis)) is None:
                return None
            operands.append(rolled)
        return self._with(first, operands)

    def _unrolled(self, values: Sequence[Expression], axis: Axis) -> Expression | None:
        """Find the family that has these values along one of its axes; return it along ``axis``."""
        family, moves = values[0].args
        for place, (of, to) in enumerate(moves):
            if to == 0 and of.size == axis.size:
                others = (*moves[:place], *moves[place + 1 :])
                expected = [self.at(family, {**dict(others), of: n}) for n in range(axis.size)]
                if all(one is other for one, other in zip(expected, values, strict=True)):
                    return self.at(family, {**dict(others), of: axis})
        return None

    def _with(self, value: Expression, operands: Sequence[Expression]) -> Expression:
        """Return the same operation on other operands."""
        if value.op == "lookup":
            return self.lookup(value.args[0], operands[0], value.dtype)
        if value.op == "cast":
            return self.cast(operands[0], value.dtype)
        return self(value.op, value.dtype, *operands) if operands else value

    def _one(
        self,
        op: str,
        dtype: torch.dtype,
        args: tuple[Any, ...],
        key: object = None,
        axes: frozenset[Axis] | None = None,
    ) -> Expression:
        if dtype not in DTYPES:
            raise Unsupported(f"no translation for {dtype}")
        key = (op, dtype, key if key is not None else args)
        if (known := self._known.get(key)) is None:
            if len(self._known) == self._most:
                raise Unsupported(f"more than {self._most:,} scalar operations")
            if axes is None:
                axes = frozenset[Axis]().union(
                    *(arg.axes for arg in args if isinstance(arg, Expression))
                )
            known = self._known[key] = Expression(op, dtype, args, axes)
        return known


def _along(
    places: Sequence[Place],
    others: Sequence[object],
    axis: Axis,
    make: Callable[[Place], Expression],
) -> Expression | None:
    """Return the elements at these places as a family, or None if they aren't evenly spaced."""
    first, stride = places[0], places[1].base - places[0].base
    for number, place in enumerate(places):
        if place.base != first.base + number * stride or place.strides != first.strides:
            return None
    if any(other != others[0] for other in others) or any(of is axis for of, _ in first.strides):
        return None
    strides = sorted([*first.strides, (axis, stride)], key=lambda item: item[0].number)
    return make(Place(first.base, tuple(strides)))


def _simpler(op: str, *args: Expression) -> Expression | None:
    match op, args:
        case "where", (_, chosen, other) if chosen is other:
            return chosen
        case "where", (condition, chosen, other) if condition.op == "constant":
            return chosen if condition.args[0] else other
        case "mul", (one, other) if _is(one, 1):
            return other
        case (("mul" | "div"), (other, one)) if _is(one, 1):
            return other
        # Not for floats: -0.0 + 0.0 is 0.0, and so is -0.0 - -0.0.
        case "add", (zero, other) if _is(zero, 0) and not zero.dtype.is_floating_point:
            return other
        case "add", (other, zero) if _is(zero, 0) and not zero.dtype.is_floating_point:
            return other
        case "sub", (other, zero) if _is(zero, 0) and copysign(1, zero.args[0]) > 0:
            return other
        case "abs", (value,) if value.op == "where" and all(map(_positive, value.operands[1:])):
            return value
    return None


def _positive(value: Expression) -> bool:
    return value.op == "constant" and copysign(1, value.args[0]) > 0 and not isnan(value.args[0])


def _is_normal(number: float) -> bool:
    """Return whether a number is zero or normal: the program counts subnormal ones as zero."""
    return number == 0 or abs(number) >= torch.finfo(torch.float32).tiny


def _is(value: Expression, number: float) -> bool:
    return value.op == "constant" and value.dtype is not torch.bool and value.args[0] == number
