"""Find the loops of which a step leaves most rows as they are.

A row is one iteration of a loop over a large family, such as the weights of one cell of a tile
coding and their traces. A row is idle if its traces are zero and the step doesn't visit it: every
change is then a product with zero. The program keeps a list of the rows that aren't idle and
computes those only. No bit of a result changes, so the conditions are strict: products with zero
are zero only if the other factor is finite, 0 · −1 is −0, and −0 + 0 is 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, prod
from typing import NamedTuple

import torch

from .expressions import WHOLE, Axis, Expression, Place, in_order
from .nests import Loop, Nests, Node, Write, is_computed_anew


@dataclass(frozen=True)
class IdleRows:
    """The conditions under which a step leaves a row of a loop as it is.

    Attributes:
        axes: the axes of the loop and of those in it; rows are numbered along them, the last axis
            varying fastest.
        body: the nodes of a row.
        visits: the numbers of the rows that a step visits; it computes these rows.
        finite: numbers that must be finite, or the step computes all rows.
        positive: numbers that must also have a positive sign.
        traces: writes of which each has left 0, not −0, in the row.
        weights: writes of which each has left another number than −0 in the row.
    """

    axes: tuple[Axis, ...]
    body: Sequence[Node]
    visits: list[Expression]
    finite: list[Expression]
    positive: list[Expression]
    traces: list[Write]
    weights: list[Write]


class _Zero(NamedTuple):
    """A number that is 0 in an idle row.

    Attributes:
        factors: the numbers whose signs must be positive to exclude −0; None if it may be −0.
    """

    factors: frozenset[Expression] | None


class _Kept(NamedTuple):
    """A number that is in an idle row what the row holds at a place."""

    leaf: int
    place: Place


_AtRest = _Zero | _Kept | bool | None
"""What is known of a number or a condition in an idle row; None if nothing."""

_OF_ZEROS = {"eq": True, "ge": True, "le": True, "ne": False, "gt": False, "lt": False}


def idle_rows(loop: Loop, nests: Nests) -> IdleRows | None:
    """Return the conditions for idle rows of a loop; None if rows can't be left out."""
    axes: list[Axis] = []
    inner: Node | Loop = loop
    while isinstance(inner, Loop):
        if not isinstance(inner.axis, Axis):
            return None
        axes.append(inner.axis)
        body, inner = inner.body, inner.body[0]
    nodes = [node for node in body if not isinstance(node, Loop)]
    writes = [node for node in nodes if isinstance(node, Write)]
    values = [node for node in nodes if isinstance(node, Expression)]
    own = {*nodes}
    leaves = {write.leaf for write in writes}
    everywhere = [write for write in nests.around if isinstance(write, Write)]
    if (
        len(nodes) < len(body)
        or not writes
        or any(value.op in WHOLE for value in values)
        or any(
            user not in own
            for value in values
            if not is_computed_anew(value)
            for user, _ in nests.users[value]
        )
        or any({axis for axis, _ in write.place.strides} != {*axes} for write in writes)
        or any(write in nests.late for write in writes)
        or any(write.leaf in leaves and write not in own for write in everywhere)
    ):
        return None
    for leaf in sorted(leaves):
        if (found := _AtRestIn(tuple(axes), writes, leaf).conditions(nodes)) is not None:
            return found
    return None


class _AtRestIn:
    """The values of a row's expressions if one leaf's numbers in the row are zero."""

    def __init__(self, axes: tuple[Axis, ...], writes: Sequence[Write], leaf: int) -> None:
        self._axes = axes
        self._traces = [write for write in writes if write.leaf == leaf]
        self._weights = [write for write in writes if write.leaf != leaf]
        self._places = {(write.leaf, write.place) for write in writes}
        self._leaf = leaf
        self._visits: dict[Expression, None] = {}
        self._finite: dict[Expression, None] = {}
        self._known: dict[Expression, _AtRest] = {}

    def conditions(self, body: Sequence[Node]) -> IdleRows | None:
        for value in in_order(write.value for write in (*self._traces, *self._weights)):
            self._known[value] = self._find(value)
        positive: dict[Expression, None] = {}
        for write in self._traces:
            after = self._known[write.value]
            if not isinstance(after, _Zero) or after.factors is None:
                return None
            positive |= dict.fromkeys(after.factors)
        if any(self._known[one.value] != _Kept(one.leaf, one.place) for one in self._weights):
            return None
        finite = [value for value in self._finite if value not in positive]
        return IdleRows(
            self._axes,
            body,
            [*self._visits],
            finite,
            [*positive],
            self._traces,
            self._weights,
        )

    def _find(self, value: Expression) -> _AtRest:
        """Return what an expression is, of whose operands that is known."""
        if value.op == "constant" and value.dtype.is_floating_point and value.args[0] == 0:
            return _Zero(frozenset() if copysign(1, value.args[0]) > 0 else None)
        if value.op == "input" and value.args[:2] in self._places:
            leaf, place, _ = value.args
            return _Zero(frozenset()) if leaf == self._leaf else _Kept(leaf, place)
        if not value.axes:
            return None
        if value.op == "eq" and self._visit(*value.operands):
            return False
        found = [self._known[operand] for operand in value.operands]
        match value.op, found:
            case "where", [bool() as which, chosen, other]:
                return chosen if which else other
            case "where", [_, _Zero(one), _Zero(other)]:
                return _Zero(_both(one, other))
            case "mul", [_Zero(one), _Zero(other)]:
                return _Zero(_both(one, other))
            case ("mul", [_Zero(), None]) | ("mul", [None, _Zero()]):
                return self._product(value, found)
            case "add", [_Zero(one), _Zero(other)]:  # one positive sign is enough
                return _Zero(one if other is None else other)
            case ("add", [_Kept() as kept, _Zero()]) | ("add", [_Zero(), _Kept() as kept]):
                return kept
            case "sub", [_Kept() as kept, _Zero()]:
                return kept
            case "abs", [_Zero()]:
                return _Zero(frozenset())
            case ("neg", [_Zero()]) | ("sub" | "maximum" | "minimum", [_Zero(), _Zero()]):
                return _Zero(None)
            case op, [_Zero(), _Zero()] if op in _OF_ZEROS:
                return _OF_ZEROS[op]
            case "cast", [False] if value.dtype.is_floating_point:
                return _Zero(frozenset())
            case ("bitwise_and", [False, _]) | ("bitwise_and", [_, False]):
                return False
            case "bitwise_or", [bool() as one, bool() as other]:
                return one or other
            case "bitwise_not", [bool() as one]:
                return not one
        return None

    def _visit(self, index: Expression, number: Expression) -> bool:
        """Return whether a comparison asks if an index is the row's number; note the index."""
        if index.op == "table":
            index, number = number, index
        if number.op != "table" or index.axes or index.dtype.is_floating_point:
            return False
        numbers, place = number.args
        steps = [prod(axis.size for axis in self._axes[n + 1 :]) for n in range(len(self._axes))]
        own = place.base == 0 and dict(place.strides) == dict(zip(self._axes, steps, strict=True))
        if not own or [*numbers] != [*range(len(numbers))] or index.dtype is torch.bool:
            return False
        self._visits[index] = None
        return True

    def _product(self, value: Expression, found: Sequence[_AtRest]) -> _AtRest:
        """Return the product of zero with a number that is the same in all rows."""
        number, zero = value.operands if found[0] is None else value.operands[::-1]
        factors = self._known[zero]
        if number.axes or not isinstance(factors, _Zero):
            return None
        self._finite[number] = None
        if number.op == "constant" and copysign(1, number.args[0]) < 0:
            return _Zero(None)
        return _Zero(None if factors.factors is None else factors.factors | {number})


def _both(
    one: frozenset[Expression] | None, other: frozenset[Expression] | None
) -> frozenset[Expression] | None:
    return None if one is None or other is None else one | other
