"""Write a step as the statements of a programming language, in the order of :mod:`.nests`.

A :class:`Language` writes numbers, formulas and arrays in its own syntax. A lane is the place of
one run in the program. The C++ of :mod:`.source` computes on vectors of lanes, the JavaScript of
:mod:`.javascript` on a single lane.
"""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, prod
from typing import Self

import torch

from .arrays import Axes
from .errors import Unsupported
from .expressions import WHOLE, Axis, Expression, Place, Where, in_order
from .idle import idle_rows
from .nests import (
    Branch,
    Loop,
    Nests,
    Node,
    Write,
    arrange,
    is_computed,
    is_computed_anew,
    shared,
)

_REGISTERS = 8
"""The largest number of sums in one loop: half of a processor's vector registers."""


INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lshift": "<<", "rshift": ">>"}
INFIX |= {"bitwise_and": "&", "bitwise_or": "|", "bitwise_xor": "^"}
"""The operators of two operands, which C++ and JavaScript write alike."""


@dataclass(frozen=True)
class Leaf:
    """One tensor of the program's input, and its new values after a step."""

    dtype: torch.dtype
    size: int
    next: Sequence[tuple[Place, Expression]]  # elements that aren't listed keep their values


class Language(ABC):
    """A programming language, whose methods write the parts of statements as text."""

    index_type: str
    """The word that declares the variable of a loop."""

    @abstractmethod
    def literal(self, number: float, dtype: torch.dtype) -> str:
        """Write a number."""

    @abstractmethod
    def same(self, literal: str, dtype: torch.dtype) -> str:
        """Write a value that is the same number in every lane."""

    @abstractmethod
    def define(self, dtype: torch.dtype, name: str, formula: str) -> str:
        """Write the definition of a constant."""

    @abstractmethod
    def declare(self, dtype: torch.dtype, name: str, first: str) -> str:
        """Write the declaration of a variable with its first value."""

    @abstractmethod
    def table(self, dtype: torch.dtype, name: str, entries: Sequence[str]) -> str:
        """Write the definition of a constant table."""

    @abstractmethod
    def entry(self, dtype: torch.dtype, table: str, index: str) -> str:
        """Write the entry of a table at an index that is the same in every lane."""

    @abstractmethod
    def lookup(self, dtype: torch.dtype, table: str, index: str) -> str:
        """Write the entry of a table at each lane's own index."""

    @abstractmethod
    def pick(self, array: str, first: str, stride: int, index: str) -> str:
        """Write the element ``first + stride · index`` of an array, at each lane's own index."""

    @abstractmethod
    def anywhere(self, mask: str) -> str:
        """Write the condition that a mask is true in at least one lane."""

    def awake(self, rows: "Rows") -> Iterable[str] | None:
        """Write a loop over the rows that aren't idle; None if the language has no such loops."""
        return None

    @abstractmethod
    def formula(self, op: str, value: Expression, operands: Sequence[str]) -> str:
        """Write an operation.

        Args:
            op: the operation: ``value.op`` or, for a reduction, the operation that combines two
                elements.
            value: the expression that the operation computes.
            operands: the text of the operands.

        Raises:
            Unsupported: if the language has no such operation.
        """


@dataclass(frozen=True)
class Rows:
    """The text of a loop over those rows of a family that aren't idle (:mod:`.idle`).

    Attributes:
        name: the name of the list of rows.
        axes: the axes of a row, of which the last varies fastest.
        visits, finite, positive: see :class:`.idle.IdleRows`.
        body: the lines that compute a row.
        traces, weights: the row's new numbers that must be 0, and those that must not be −0.
    """

    name: str
    axes: Axes
    visits: Sequence[str]
    finite: Sequence[str]
    positive: Sequence[str]
    body: Sequence[str]
    traces: Sequence[str]
    weights: Sequence[str]


class Statements:
    """The statements that compute expressions, as variables or as elements of arrays.

    Args:
        language: the language to write in.
        every: all expressions, each after its operands.
        once: the expressions that are computed once, before the first step.
        nests: the order and the loops of all other expressions.
    """

    def __init__(
        self,
        language: Language,
        every: Sequence[Expression],
        once: Sequence[Expression],
        nests: Nests,
    ) -> None:
        self._language, self.every = language, every
        self._constants = [value for value in every if value.op == "constant"]
        self._once, self._nests = once, nests
        self._names = {value: f"c{number}" for number, value in enumerate(self._constants)}
        computed = [value for value in every if is_computed(value)]
        self._names |= {value: f"v{number}" for number, value in enumerate(computed)}
        tables = {_table(value): value for value in every if value.op in ("lookup", "table")}
        self._tables = {
            key: (f"table_{number}", value.args[0])
            for number, (key, value) in enumerate(tables.items())
        }
        self._late = {write: f"late_{number}" for number, write in enumerate(nests.late)}
        self._opened: dict[Loop, list[Expression]] = defaultdict(list)
        self._kept: dict[Loop, list[Expression]] = defaultdict(list)
        self._homes: dict[Expression, tuple[Loop, ...]] = {}
        self._inner: dict[Expression, Axes] = {}
        self._axes: dict[Expression, Axes] = {}
        for value in nests.around:
            if isinstance(value, Expression):
                self._settle(value)
        self._assigned = {value for values in self._kept.values() for value in values}
        loops = [one for one in nests.whole.body if isinstance(one, Loop)]
        found = {loop: idle_rows(loop, nests) for loop in loops}
        self._idle = {loop: idle for loop, idle in found.items() if idle is not None}
        self._row: Axes = ()

    @classmethod
    def of(cls, language: Language, leaves: Sequence[Leaf]) -> Self:
        """Order the statements of a step, which changes the leaves in place."""
        writes = _writes(leaves)
        every = in_order(write.value for write in writes)
        changed = {write.leaf for write in writes}
        once = dict[Expression, None]()
        for value in every:
            known = (
                operand in once
                or operand.op == "constant"
                or (operand.op == "input" and operand.args[0] not in changed)
                for operand in value.operands
            )
            if is_computed(value) and not value.axes and value.op not in WHOLE and all(known):
                once[value] = None
        return cls(language, every, [*once], arrange(writes, once.keys()))

    @property
    def changed(self) -> set[int]:
        """The numbers of the leaves that a step changes."""
        return {write.leaf for write in self._nests.around if isinstance(write, Write)}

    def _settle(self, value: Expression) -> None:
        """Find the loops around a value's computation; a value read outside them needs an array."""
        home, inner = self._nests.around[value], tuple[Axis, ...]()
        if value.op == "fold":
            depth = [loop.axis for loop in home].index(value.args[1])
            self._opened[home[depth]].append(value)
            home, inner = home[:depth], _axes(home[depth + 1 :])
        elif value.op == "pack":
            inner = (value.args[0],)
        users = self._nests.users[value]
        both = min(len(shared(home, self._nests.around[user])) for user, _ in users)
        self._homes[value], self._inner[value] = home, inner
        if axes := _axes(home[both:]) + inner:
            if not is_computed_anew(value) or any(moved for _, moved in users):
                self._axes[value] = axes
        elif both < len(home):  # a branch's result
            self._kept[home[-1]].append(value)

    def arrays(self) -> dict[str, tuple[torch.dtype, int]]:
        """Return the dtype and the size of each intermediate array, by the array's name."""
        arrays = {
            self._array(value): (value.dtype, prod(axis.size for axis in axes))
            for value, axes in self._axes.items()
        }
        for write, name in self._late.items():
            size = prod(axis.size for axis, _ in write.place.strides)
            arrays[name] = (write.value.dtype, size)
        return arrays

    def rows(self) -> dict[str, int]:
        """Return the number of rows in each list of rows, by the list's name."""
        return {
            _rows_name(number): prod(axis.size for axis in idle.axes)
            for number, idle in enumerate(self._idle.values())
        }

    def tables(self) -> list[str]:
        """Return the definitions of the constant tables."""
        return [
            self._language.table(
                dtype, name, [self._language.literal(entry, dtype) for entry in entries]
            )
            for (dtype, _), (name, entries) in self._tables.items()
        ]

    def constants(self) -> Iterable[str]:
        """Return the definitions of the constants, one per line."""
        for value in self._constants:
            literal = self._language.literal(value.args[0], value.dtype)
            number = self._language.same(literal, value.dtype)
            yield self._language.define(value.dtype, self._names[value], number)

    def once(self) -> Iterable[str]:
        """Return the definitions of the expressions that are computed before the first step."""
        return (self._definition(value, ()) for value in self._once)

    def body(self) -> Iterable[str]:
        """Return the lines of one step."""
        yield from self._lines((self._nests.whole,), self._nests.whole.body)
        for write, name in self._late.items():
            axes = tuple(axis for axis, _ in write.place.strides)
            to = f"{leaf_name(write.leaf)}[{self._index(write.place)}]"
            yield self._looped(axes, f"{to} = {name}[{self._index(_row_major(axes))}];")
        for write in [node for node in self._nests.around if isinstance(node, Write)]:
            if write.source is not None:
                due, index = self._name(write.value, (self._nests.whole,)), self._index(write.place)
                to, taken = (f"{leaf_name(n)}[{index}]" for n in (write.leaf, write.source))
                axes = tuple(axis for axis, _ in write.place.strides)
                chosen = self._language.formula("where", write.value, [due, taken, to])
                line = self._looped(axes, f"{to} = {chosen};")
                yield f"if ({self._language.anywhere(due)}) {line}"

    def _lines(self, around: tuple[Loop, ...], body: Sequence[Node | Loop]) -> Iterable[str]:
        for one in body:
            if isinstance(one, Loop) and isinstance(one.axis, Branch):
                for value in self._kept[one]:
                    zero = self._language.same(self._language.literal(0, value.dtype), value.dtype)
                    yield self._language.declare(value.dtype, self._names[value], zero)
                mask = self._name(one.axis.mask, around)
                yield f"if ({self._language.anywhere(mask)}) {{"
                yield from ("    " + line for line in self._lines((*around, one), one.body))
                yield "}"
                kept = []
            elif isinstance(one, Loop):
                assert isinstance(one.axis, Axis)
                if (lines := self._awake(one, around)) is not None:
                    yield from lines
                    continue
                yield from map(self._before, self._opened[one])
                for part in self._parts(one):
                    yield f"{self._for(one.axis)} {{"
                    yield from ("    " + line for line in self._lines((*around, one), part))
                    yield "}"
                kept = [value for value in self._opened[one] if not self._inner[value]]
            elif isinstance(one, Write):
                to, kept = self._written(one), []
                if one in self._late:
                    axes = tuple(axis for axis, _ in one.place.strides)
                    to = f"{self._late[one]}[{self._index(_row_major(axes))}]"
                if one.source is None:
                    yield f"{to} = {self._name(one.value, around)};"
            elif one.op == "fold":
                op, _, operand = one.args
                total, kept = self._element(one, {}) if self._inner[one] else self._names[one], []
                formula = self._language.formula(op, one, [total, self._name(operand, around)])
                yield f"{total} = {formula};"
            elif one.op == "pack":
                (axis, *values), kept = one.args, []
                for number, value in enumerate(values):
                    yield f"{self._element(one, {axis: number})} = {self._name(value, around)};"
            else:
                yield self._definition(one, around)
                kept = [one]
            for value in kept:
                if value in self._axes:
                    yield f"{self._element(value, {})} = {self._names[value]};"

    def _awake(self, loop: Loop, around: tuple[Loop, ...]) -> Iterable[str] | None:
        """Return the lines of a loop over the rows that aren't idle; None without such rows."""
        if loop not in self._idle:
            return None
        idle = self._idle[loop]
        inside = self._nests.around[idle.body[0]]

        def names(values: Iterable[Expression], where: tuple[Loop, ...]) -> list[str]:
            return [self._name(value, where) for value in values]

        self._row = idle.axes
        rows = Rows(
            _rows_name([*self._idle].index(loop)),
            idle.axes,
            visits=names(idle.visits, around),
            finite=names(idle.finite, around),
            positive=names(idle.positive, around),
            body=[*self._lines(inside, idle.body)],
            traces=names((write.value for write in idle.traces), inside),
            weights=[self._written(write) for write in idle.weights],
        )
        self._row = ()
        return self._language.awake(rows)

    def _parts(self, loop: Loop) -> Sequence[Sequence[Node | Loop]]:
        """Split a loop with many sums into several loops, each of which needs fewer registers."""
        body = [node for node in loop.body if isinstance(node, Expression)]
        folds = [value for value in self._opened[loop] if not self._inner[value]]
        if (
            len(folds) <= _REGISTERS
            or len(body) < len(loop.body)
            or any(value in self._axes or value.op == "pack" for value in body)
        ):
            return [loop.body]
        number = -(-len(folds) // _REGISTERS)
        parts = []
        for n in range(number):
            mine = {*folds[n * len(folds) // number : (n + 1) * len(folds) // number]}
            needed = [value for value in in_order(mine) if value in self._homes]
            parts.append([value for value in body if value in mine or value in {*needed}])
        return parts

    def _before(self, fold: Expression) -> str:
        """Return the line before a loop that initialises a reduction in it."""
        literal = self._language.literal(_neutral(fold), fold.dtype)
        first = self._language.same(literal, fold.dtype)
        if axes := self._inner[fold]:
            return self._looped(axes, f"{self._element(fold, {})} = {first};")
        if fold in self._assigned:
            return f"{self._names[fold]} = {first};"
        return self._language.declare(fold.dtype, self._names[fold], first)

    def _definition(self, value: Expression, around: tuple[Loop, ...]) -> str:
        if value.op == "pick":
            of, chain, index = value.args
            array, first = self._place(of, dict.fromkeys(chain, 0))
            at = self._name(index, around)
            formula = self._language.pick(array, first, self._stride(of, chain), at)
        elif value.op == "lookup":
            table, _ = self._tables[_table(value)]
            at = self._name(value.operands[0], around)
            formula = self._language.lookup(value.dtype, table, at)
        else:
            operands = [self._name(operand, around) for operand in value.operands]
            formula = self._language.formula(value.op, value, operands)
        if value in self._assigned:
            return f"{self._names[value]} = {formula};"
        return self._language.define(value.dtype, self._names[value], formula)

    def _stride(self, family: Expression, chain: Axes) -> int:
        """Return the distance in memory between a family's neighbours along merged axes.

        Raises:
            Unsupported: if the distance isn't the same everywhere.
        """
        place = self._places(family)
        strides = dict(place.strides)
        *outer, last = chain
        expected = strides[last]
        for axis, inner in zip(outer[::-1], chain[:0:-1], strict=True):
            expected *= inner.size
            if strides[axis] != expected:
                raise Unsupported("no translation for an index into dimensions that lie apart")
        return strides[last]

    def _places(self, family: Expression) -> Place:
        """Return the place of a family's numbers in the array that holds them."""
        if family.op == "input":
            place: Place = family.args[1]
            return place
        if family.op == "at":
            of, moves = family.args
            return self._places(of).at(dict(moves))
        return _row_major(self._axes[family])

    def _name(self, value: Expression, around: tuple[Loop, ...]) -> str:
        """Return the text that reads a value inside the given loops."""
        if value.op == "table":
            table, _ = self._tables[_table(value)]
            return self._language.entry(value.dtype, table, self._index(value.args[1]))
        if value.op in ("input", "at"):
            return self._element(value, {})
        if value in self._axes:
            home = self._homes[value]
            if self._inner[value] or around[: len(home)] != home:
                return self._element(value, {})
        elif value.axes and around[: len(self._homes[value])] != self._homes[value]:
            operands = [self._name(operand, around) for operand in value.operands]
            return f"({self._language.formula(value.op, value, operands)})"
        return self._names[value]

    def _element(self, value: Expression, where: Where) -> str:
        array, index = self._place(value, where)
        return f"{array}[{index}]"

    def _place(self, value: Expression, where: Where) -> tuple[str, str]:
        """Return the array that holds a value, and the index there after a substitution of axes."""
        index = self._index(self._places(value).at(where))
        if value.op == "input":
            return leaf_name(value.args[0]), index
        return self._array(value.args[0] if value.op == "at" else value), index

    def _written(self, write: Write) -> str:
        return f"{leaf_name(write.leaf)}[{self._index(write.place)}]"

    def _index(self, place: Place) -> str:
        """Return the text of an index; in a loop over rows, in terms of the row's number."""
        strides, rows = dict(place.strides), dict(_row_major(self._row).strides)
        step = strides.get(self._row[-1], 0) if self._row else 0
        if step and strides == {axis: step * size for axis, size in rows.items()}:
            return f"{step} * row + {place.base}"
        return _index(place)

    def _for(self, axis: Axis) -> str:
        name = f"i{axis.number}"
        return f"for ({self._language.index_type} {name} = 0; {name} < {axis.size}; ++{name})"

    def _looped(self, axes: Iterable[Axis], line: str) -> str:
        return " ".join([*map(self._for, axes), line])

    def _array(self, value: Expression) -> str:
        return f"of_{self._names[value]}"


def _writes(leaves: Sequence[Leaf]) -> list[Write]:
    """Return the writes of a step; the write of a masked copy names the leaf that is copied.

    The program skips a masked copy in the steps where no lane needs the copy. An example is the
    copy of the weights for an evaluation, which is large and rarely needed.
    """
    all_of = [(n, place, new) for n, leaf in enumerate(leaves) for place, new in leaf.next]
    by_value = {(place, new): leaf for leaf, place, new in all_of if place.strides}
    writes = []
    for leaf, place, new in all_of:
        if new.op == "where" and place.strides:
            due, taken, kept = new.operands
            source = by_value.get((place, taken)) if taken.op != "where" else None
            own = kept.op == "input" and kept.args[:2] == (leaf, place)
            if own and source is not None and not due.axes and is_computed(due):
                writes.append(Write(leaf, place, due, source))
                continue
        writes.append(Write(leaf, place, new))
    return writes


def _table(value: Expression) -> tuple[torch.dtype, str]:
    """Return the key of a look-up's table: the dtype and the text of the table's numbers."""
    return value.dtype, repr(value.args[0])


def _neutral(fold: Expression) -> float:
    """Return the neutral element of a reduction's operation."""
    op, dtype = fold.args[0], fold.dtype
    if dtype.is_floating_point or dtype is torch.bool or op in ("mul", "bitwise_xor"):
        firsts = {"add": -0.0, "maximum": -inf, "minimum": inf}
        whole = op in ("mul", "bitwise_and")
        return firsts.get(op, whole) if dtype.is_floating_point else whole
    limits = torch.iinfo(dtype)
    return {"add": 0, "maximum": limits.min, "minimum": limits.max}[op]


def _axes(loops: Iterable[Loop]) -> Axes:
    return tuple(loop.axis for loop in loops if isinstance(loop.axis, Axis))


def _index(place: Place) -> str:
    terms = [f"{stride} * i{axis.number}" for axis, stride in place.strides]
    return " + ".join([*terms, str(place.base)] if place.base or not terms else terms)


def _rows_name(number: int) -> str:
    return f"rows_{number}"


def _row_major(axes: Axes) -> Place:
    """Return the row-major index into an array with these axes."""
    strides = [prod(axis.size for axis in axes[n + 1 :]) for n in range(len(axes))]
    return Place(0, tuple(zip(axes, strides, strict=True)))


def leaf_name(number: int) -> str:
    """Return the name of a leaf in the program."""
    return f"leaf_{number}"
