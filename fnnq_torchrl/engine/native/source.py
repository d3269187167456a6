"""Write scalar expressions as a C++ program, a loop of steps on one vector of lanes at a time."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, isnan, prod
from string import Template

import torch

from .arrays import Axes
from .errors import Unsupported
from .expressions import (
    COMPARISONS,
    WHOLE,
    Axis,
    Expression,
    Place,
    Where,
    in_order,
)
from .nests import Loop, Nests, Node, Write, arrange, is_computed, shared
from .prelude import PRELUDE, RUN, VECTORISED

_TYPES = {
    torch.float32: "f32",
    torch.float64: "f64",
    torch.int32: "i32",
    torch.int64: "i64",
    torch.bool: "mask",
}
_NUMBERS = {
    torch.float32: "float",
    torch.float64: "double",
    torch.int32: "int32_t",
    torch.int64: "int64_t",
    torch.bool: "uint8_t",
}
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lshift": "<<", "rshift": ">>"}
_INFIX |= {"bitwise_and": "&", "bitwise_or": "|", "bitwise_xor": "^"}
_COMPARISONS = dict(zip(COMPARISONS, ("==", "!=", "<", "<=", ">", ">="), strict=True))
_PREFIX = {"neg": "-", "bitwise_not": "~", "copy": ""}
_CALLS = ("where", "maximum", "minimum")
_LIMITS = {"maximum": "at_least", "minimum": "at_most"}  # for a constant second operand
_PLAIN = {name: name for name in ("ceil", "floor", "fmod", "sqrt", "trunc")}
_PLAIN |= {"abs": "fabs", "round": "rint"}
_VECTORISED = {"acos", "asin", "atan", "atan2", "cos", "cosh", "erf", "exp", "expm1", "log"}
_VECTORISED |= {"log1p", "pow", "sin", "sinh", "tan", "tanh"}
FUNCTIONS = _PLAIN | {name: name for name in _VECTORISED}
"""The C library's functions, by torch's names."""


_REGISTERS = 8
"""The most sums in one loop: half of a processor's vector registers."""

_SMALL = 64
"""The most vectors of an array on the stack; larger arrays are on the heap."""


@dataclass(frozen=True)
class Leaf:
    """One tensor of the program's input, and its new values after a step."""

    dtype: torch.dtype
    size: int
    next: Sequence[tuple[Place, Expression]]  # elements that aren't listed keep their values


def program(leaves: Sequence[Leaf], over: int | None = None) -> str:
    """Return the text of a C++ program with one function, ``run(lanes, steps, leaves)``.

    The function changes the leaves in place, each ``[elements, lanes]``.

    Args:
        leaves: the tensors, in the order in which the function takes them.
        over: the number of the boolean leaf that marks finished lanes, if there is one.

    Raises:
        Unsupported: if an operation has no translation.
    """
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
    real = torch.float64 if any(leaf.dtype is torch.float64 for leaf in leaves) else torch.float32
    write = _Statements(every, [*once], arrange(writes, once.keys()))
    body = [*write.body()]
    if over is not None:
        body.append(f"if (everywhere({_leaf(over)}[0])) break;")
    prelude = Template(PRELUDE).substitute(
        real=_NUMBERS[real], mask="i64" if real is torch.float64 else "i32"
    )
    vectorised = {_declaration(value) for value in every if value.op in _VECTORISED}
    arrays = {_leaf(n): (leaf.dtype, leaf.size) for n, leaf in enumerate(leaves)} | write.arrays()
    large = {name: of for name, of in arrays.items() if of[1] > _SMALL}
    small = {name: of for name, of in arrays.items() if of[1] <= _SMALL}
    run = Template(RUN).substitute(
        memory=_lines(4, _declared(large)),
        constants=_lines(4, write.constants()),
        arrays=_lines(
            8, [*_declared(small), *(f"auto& {name} = memory->{name};" for name in large)]
        ),
        loads=_lines(8, (line for n, leaf in enumerate(leaves) for line in _loads(n, leaf))),
        once=_lines(8, write.once()),
        body=_lines(12, body),
        stores=_lines(
            8, (line for n, leaf in enumerate(leaves) if n in changed for line in _stores(n, leaf))
        ),
    )
    return "\n".join([prelude, *sorted(vectorised), *write.tables(), run])


def _writes(leaves: Sequence[Leaf]) -> list[Write]:
    """Return the writes of a step; masked copies from another leaf have a source of their own.

    The program skips a masked copy in the steps where no lane needs it. An example is the copy of
    the weights for an evaluation, which is large and rarely needed.
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


class _Statements:
    """The C++ statements that compute expressions, as variables or as elements of arrays.

    Args:
        every: all expressions, each after its operands.
        once: the expressions that are computed once, before the first step.
        nests: the order and the loops of the others.
    """

    def __init__(
        self, every: Sequence[Expression], once: Sequence[Expression], nests: Nests
    ) -> None:
        self._constants = [value for value in every if value.op == "constant"]
        self._once, self._nests = once, nests
        self._names = {value: f"c{number}" for number, value in enumerate(self._constants)}
        computed = [value for value in every if is_computed(value)]
        self._names |= {value: f"v{number}" for number, value in enumerate(computed)}
        tables = {_table(value): None for value in every if value.op in ("lookup", "table")}
        self._tables = {table: f"table_{number}" for number, table in enumerate(tables)}
        self._late = {write: f"late_{number}" for number, write in enumerate(nests.late)}
        self._opened: dict[Loop, list[Expression]] = defaultdict(list)
        self._homes: dict[Expression, tuple[Loop, ...]] = {}
        self._inner: dict[Expression, Axes] = {}
        self._axes: dict[Expression, Axes] = {}
        for value in nests.around:
            if isinstance(value, Expression):
                self._settle(value)

    def _settle(self, value: Expression) -> None:
        """Find the loops that a value is computed in; if it is read outside, it needs an array."""
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
            self._axes[value] = axes

    def arrays(self) -> dict[str, tuple[torch.dtype, int]]:
        """Return the dtype and the size of each array that a vector of lanes needs, by name."""
        arrays = {
            self._array(value): (value.dtype, prod(axis.size for axis in axes))
            for value, axes in self._axes.items()
        }
        for write, name in self._late.items():
            size = prod(axis.size for axis, _ in write.place.strides)
            arrays[name] = (write.value.dtype, size)
        return arrays

    def tables(self) -> list[str]:
        """Return the definitions of the constant tables."""
        return [f"const {table[0]} {name}[] = {table[1]};" for table, name in self._tables.items()]

    def constants(self) -> Iterable[str]:
        """Return the definitions of the constants, one per line."""
        for value in self._constants:
            literal = _literal(value.args[0], value.dtype)
            yield f"const {_TYPES[value.dtype]} {self._names[value]} = {_all(value, literal)};"

    def once(self) -> Iterable[str]:
        """Return the definitions of the expressions that are computed before the first step."""
        return (self._definition(value, ()) for value in self._once)

    def body(self) -> Iterable[str]:
        """Return the lines of one step."""
        yield from self._lines((self._nests.whole,), self._nests.whole.body)
        for write, name in self._late.items():
            axes = tuple(axis for axis, _ in write.place.strides)
            to = f"{_leaf(write.leaf)}[{_index(write.place)}]"
            yield _looped(axes, f"{to} = {name}[{_row_major(axes, {})}];")
        for write in [node for node in self._nests.around if isinstance(node, Write)]:
            if write.source is not None:
                due, index = self._name(write.value, (self._nests.whole,)), _index(write.place)
                to, taken = f"{_leaf(write.leaf)}[{index}]", f"{_leaf(write.source)}[{index}]"
                axes = tuple(axis for axis, _ in write.place.strides)
                line = _looped(axes, f"{to} = where({due}, {taken}, {to});")
                yield f"if (anywhere({due})) {line}"

    def _lines(self, around: tuple[Loop, ...], body: Sequence[Node | Loop]) -> Iterable[str]:
        for one in body:
            if isinstance(one, Loop):
                assert one.axis is not None
                yield from map(self._before, self._opened[one])
                for part in self._parts(one):
                    yield f"{_for(one.axis)} {{"
                    yield from ("    " + line for line in self._lines((*around, one), part))
                    yield "}"
                kept = [value for value in self._opened[one] if not self._inner[value]]
            elif isinstance(one, Write):
                to, kept = f"{_leaf(one.leaf)}[{_index(one.place)}]", []
                if one in self._late:
                    axes = tuple(axis for axis, _ in one.place.strides)
                    to = f"{self._late[one]}[{_row_major(axes, {})}]"
                if one.source is None:
                    yield f"{to} = {self._name(one.value, around)};"
            elif one.op == "fold":
                op, _, operand = one.args
                total, kept = self._element(one, {}) if self._inner[one] else self._names[one], []
                formula = _formula(op, one, [total, self._name(operand, around)])
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
        type_, first = _TYPES[fold.dtype], _all(fold, _first(fold))
        if axes := self._inner[fold]:
            return _looped(axes, f"{self._element(fold, {})} = {first};")
        return f"{type_} {self._names[fold]} = {first};"

    def _definition(self, value: Expression, around: tuple[Loop, ...]) -> str:
        if value.op == "pick":
            of, axis, index = value.args
            stride = self._stride(of, axis)
            first = self._name(of, (), {axis: 0})
            formula = f"pick(&{first}, {stride}, {self._name(index, around)})"
        else:
            operands = [self._name(operand, around) for operand in value.operands]
            if value.op == "lookup":
                operands.insert(0, self._tables[_table(value)])
            formula = _formula(value.op, value, operands)
        return f"const {_TYPES[value.dtype]} {self._names[value]} = {formula};"

    def _stride(self, family: Expression, axis: Axis) -> int:
        """Return the distance in memory between a family's neighbours along an axis."""
        if family.op == "input":
            return dict(family.args[1].strides)[axis]
        if family.op == "at":
            of, moves = family.args
            return self._stride(of, next((old for old, new in moves if new is axis), axis))
        axes = self._axes[family]
        return prod(inner.size for inner in axes[axes.index(axis) + 1 :])

    def _name(self, value: Expression, around: tuple[Loop, ...], where: Where | None = None) -> str:
        """Return the C++ expression that reads a value.

        Args:
            value: the value.
            around: the loops around the reader.
            where: a substitution of the value's axes.
        """
        where = where or {}
        if value.op == "input":
            return f"{_leaf(value.args[0])}[{_index(value.args[1].at(where))}]"
        if value.op == "table":
            entry = f"{self._tables[_table(value)]}[{_index(value.args[1])}]"
            return _all(value, f"-{entry}" if value.dtype is torch.bool else entry)
        if value.op == "at":
            family, moves = value.args
            moved = {old: where.get(new, new) for old, new in moves}
            return self._element(family, {**where, **moved})
        if value in self._axes:
            home = self._homes[value]
            if where or self._inner[value] or around[: len(home)] != home:
                return self._element(value, where)
        return self._names[value]

    def _element(self, value: Expression, where: Where) -> str:
        """Return the C++ expression for an element of a value's array."""
        return f"{self._array(value)}[{_row_major(self._axes[value], where)}]"

    def _array(self, value: Expression) -> str:
        return f"of_{self._names[value]}"


def _formula(op: str, value: Expression, operands: Sequence[str]) -> str:
    type_ = _TYPES[value.dtype]
    if op in _INFIX:
        return f" {_INFIX[op]} ".join(operands)
    if op in _COMPARISONS:
        return f"cast<mask>({f' {_COMPARISONS[op]} '.join(operands)})"
    if op in _PREFIX:
        return _PREFIX[op] + operands[0]
    if op in _LIMITS and _is_number(value.operands[-1]):
        return f"{_LIMITS[op]}({', '.join(operands)})"
    if op in _CALLS:
        return f"{op}({', '.join(operands)})"
    if op in FUNCTIONS:
        call = _call(op, value.dtype, ("x", "y")[: len(operands)])
        number = _NUMBERS[value.dtype]
        function = f"[]({number} x, {number} y) {{ return {call}; }}"
        return f"each<{number}>({operands[0]}, {operands[-1]}, {function})"
    if op == "lookup":
        found = f"lookup<{type_}>({', '.join(operands)})"
        return f"-{found}" if value.dtype is torch.bool else found
    if op == "cast":
        return _cast(value.operands[0].dtype, value.dtype, operands[0])
    raise Unsupported(f"no translation for {op}")


def _is_number(value: Expression) -> bool:
    return value.op == "constant" and value.args[0] == value.args[0]


def _first(fold: Expression) -> str:
    """Return the neutral element of a reduction's operation, as a literal."""
    op, dtype = fold.args[0], fold.dtype
    if dtype.is_floating_point or dtype is torch.bool or op in ("mul", "bitwise_xor"):
        firsts = {"add": -0.0, "maximum": -inf, "minimum": inf}
        whole = op in ("mul", "bitwise_and")
        return _literal(firsts.get(op, whole) if dtype.is_floating_point else whole, dtype)
    limits = torch.iinfo(dtype)
    return _literal({"add": 0, "maximum": limits.min, "minimum": limits.max}[op], dtype)


def _all(value: Expression, number: str) -> str:
    return f"all<{_TYPES[value.dtype]}>({number})"


def _for(axis: Axis) -> str:
    name = f"i{axis.number}"
    return f"for (int {name} = 0; {name} < {axis.size}; ++{name})"


def _looped(axes: Iterable[Axis], line: str) -> str:
    return " ".join([*map(_for, axes), line])


def _axes(loops: Iterable[Loop]) -> Axes:
    return tuple(loop.axis for loop in loops if loop.axis is not None)


def _index(place: Place) -> str:
    terms = [f"{stride} * i{axis.number}" for axis, stride in place.strides]
    return " + ".join([*terms, str(place.base)] if place.base or not terms else terms)


def _row_major(axes: Axes, where: Where) -> str:
    """Return the row-major index into an array with these axes, after a substitution of axes."""
    strides = [prod(axis.size for axis in axes[n + 1 :]) for n in range(len(axes))]
    return _index(Place(0, tuple(zip(axes, strides, strict=True))).at(where))


def _leaf(number: int) -> str:
    return f"leaf_{number}"


def _declared(arrays: Mapping[str, tuple[torch.dtype, int]]) -> Iterable[str]:
    return (f"{_TYPES[dtype]} {name}[{size}];" for name, (dtype, size) in arrays.items())


def _cast(of: torch.dtype, to: torch.dtype, operand: str) -> str:
    if to is torch.bool:
        return f"cast<mask>({operand} != 0)"
    if of is torch.bool:
        type_ = _TYPES[to]
        return f"where({operand}, all<{type_}>(1), all<{type_}>(0))"
    return f"cast<{_TYPES[to]}>({operand})"


def _call(op: str, dtype: torch.dtype, operands: Iterable[str]) -> str:
    if not dtype.is_floating_point:
        raise Unsupported(f"no translation for {op} of whole numbers")
    return f"::{FUNCTIONS[op]}{'f' if dtype is torch.float32 else ''}({', '.join(operands)})"


def _declaration(value: Expression) -> str:
    number = _NUMBERS[value.dtype]
    function = _call(value.op, value.dtype, [number] * len(value.operands)).removeprefix("::")
    return Template(VECTORISED).substitute(number=number, function=function)


def _literal(value: float, dtype: torch.dtype) -> str:
    if dtype is torch.bool:
        return "-1" if value else "0"
    if not dtype.is_floating_point:
        # C++ has no literal for the least 64-bit integer.
        return f"INT64_C({value + 1}) - 1" if value == -(2**63) else f"INT64_C({value})"
    if isnan(value):
        return "NAN"
    return float(value).hex() if isfinite(value) else f"{'-' if value < 0 else ''}INFINITY"


def _table(lookup: Expression) -> tuple[str, str]:
    """Return the C++ type of a table's numbers and its initialiser."""
    if lookup.dtype is torch.bool:
        entries = ", ".join(str(int(entry)) for entry in lookup.args[0])
    else:
        entries = ", ".join(_literal(entry, lookup.dtype) for entry in lookup.args[0])
    return _NUMBERS[lookup.dtype], f"{{{entries}}}"


def _loads(number: int, leaf: Leaf) -> Iterable[str]:
    name = _leaf(number)
    yield f"for (int e = 0; e < {leaf.size}; ++e)"
    yield f"    load<{_NUMBERS[leaf.dtype]}>({name}[e], leaf[{number}], e * lanes + lane);"
    if leaf.dtype is torch.bool:
        yield f"for (mask& each : {name}) each = -each;"


def _stores(number: int, leaf: Leaf) -> Iterable[str]:
    sign = "-" if leaf.dtype is torch.bool else ""
    yield f"for (int e = 0; e < {leaf.size}; ++e)"
    yield (
        f"    store<{_NUMBERS[leaf.dtype]}>({sign}{_leaf(number)}[e], leaf[{number}], "
        "e * lanes + lane);"
    )


def _lines(indent: int, lines: Iterable[str]) -> str:
    return "\n".join(" " * indent + line for line in lines)
