"""Scalar expressions as a C++ program: a native loop of steps, a vector of lanes at a time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from string import Template

import torch

from .expressions import COMPARISONS, Expression, Unsupported, in_order
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
_PLAIN = {name: name for name in ("ceil", "floor", "fmod", "sqrt", "trunc")}
_PLAIN |= {"abs": "fabs", "round": "rint"}
_VECTORISED = {"acos", "asin", "atan", "atan2", "cos", "cosh", "erf", "exp", "expm1", "log"}
_VECTORISED |= {"log1p", "pow", "sin", "sinh", "tan", "tanh"}
FUNCTIONS = _PLAIN | {name: name for name in _VECTORISED}
"""Of the C library, by torch's names."""


@dataclass(frozen=True)
class Leaf:
    """A tensor that the program is given, and what a step makes of it."""

    dtype: torch.dtype
    elements: Sequence[Expression]
    next: Sequence[Expression]  # what stays is its own next


def program(leaves: Sequence[Leaf], over: int | None = None) -> str:
    """The text of a program with one function, ``run(lanes, steps, leaves)``.

    It changes the leaves where they are, ``[elements, lanes]``.

    Args:
        leaves: in the order in which the function takes them.
        over: the leaf, if any, that says which lanes need no further steps.

    Raises:
        Unsupported: an operation has no translation.
    """
    changes = {
        old: new
        for leaf in leaves
        for old, new in zip(leaf.elements, leaf.next, strict=True)
        if new is not old
    }
    # What moves on to another place is taken before that place has its own next.
    changes = {
        old: Expression("copy", new.dtype, (new,)) if new.op == "input" else new
        for old, new in changes.items()
    }
    order = in_order(changes.values())
    constants = [value for value in order if value.op == "constant"]
    computed = [value for value in order if value.op not in ("constant", "input")]
    varying = set(changes)
    for value in computed:
        if any(operand in varying for operand in value.operands):
            varying.add(value)
    real = torch.float64 if any(leaf.dtype is torch.float64 for leaf in leaves) else torch.float32

    write = _Statements(constants, computed)
    prelude = Template(PRELUDE).substitute(
        real=_NUMBERS[real], mask="i64" if real is torch.float64 else "i32"
    )
    vectorised = {_declaration(value) for value in computed if value.op in _VECTORISED}
    run = Template(RUN).substitute(
        constants=_lines(4, write.definitions(constants)),
        loads=_lines(8, (line for n, leaf in enumerate(leaves) for line in _loads(n, leaf))),
        once=_lines(8, write.definitions(value for value in computed if value not in varying)),
        body=_lines(
            12,
            [
                *write.definitions(value for value in computed if value in varying),
                *(f"{write.name(old)} = {write.name(new)};" for old, new in changes.items()),
                *([] if over is None else [f"if (everywhere({_place(over, 0)})) break;"]),
            ],
        ),
        stores=_lines(
            8, (line for n, leaf in enumerate(leaves) for line in _stores(n, leaf, changes))
        ),
    )
    return "\n".join([prelude, *sorted(vectorised), *write.tables(), run])


class _Statements:
    """Expressions as definitions of variables.

    Args:
        constants, computed: all that have a variable, but for the inputs.
    """

    def __init__(self, constants: Sequence[Expression], computed: Sequence[Expression]) -> None:
        self._names = {value: f"c{number}" for number, value in enumerate(constants)}
        self._names |= {value: f"v{number}" for number, value in enumerate(computed)}
        lookups = [value for value in computed if value.op == "lookup"]
        tables = {_table(lookup): lookup for lookup in lookups}
        self._tables = {table: f"table_{number}" for number, table in enumerate(tables)}

    def tables(self) -> list[str]:
        """The tables that entries are looked up in."""
        return [f"const {table[0]} {name}[] = {table[1]};" for table, name in self._tables.items()]

    def definitions(self, values: Iterable[Expression]) -> Iterable[str]:
        """A line for each."""
        for value in values:
            formula = self._formula(value, [self.name(operand) for operand in value.operands])
            yield f"const {_TYPES[value.dtype]} {self.name(value)} = {formula};"

    def name(self, value: Expression) -> str:
        """Of its variable."""
        return _place(*value.args) if value.op == "input" else self._names[value]

    def _formula(self, value: Expression, operands: Sequence[str]) -> str:
        op, type_ = value.op, _TYPES[value.dtype]
        if op == "constant":
            return f"all<{type_}>({_literal(value.args[0], value.dtype)})"
        if op in _INFIX:
            return f" {_INFIX[op]} ".join(operands)
        if op in _COMPARISONS:
            return f"cast<mask>({f' {_COMPARISONS[op]} '.join(operands)})"
        if op in _PREFIX:
            return _PREFIX[op] + operands[0]
        if op in _CALLS:
            return f"{op}({', '.join(operands)})"
        if op in FUNCTIONS:
            call = _call(op, value.dtype, ("x", "y")[: len(operands)])
            number = _NUMBERS[value.dtype]
            function = f"[]({number} x, {number} y) {{ return {call}; }}"
            return f"each<{number}>({operands[0]}, {operands[-1]}, {function})"
        if op == "lookup":
            found = f"lookup<{type_}>({self._tables[_table(value)]}, {operands[0]})"
            return f"-{found}" if value.dtype is torch.bool else found
        if op == "cast":
            return _cast(value.operands[0].dtype, value.dtype, operands[0])
        raise Unsupported(f"no translation for {op}")


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
        # The least numbers have no literals of their own.
        return f"INT64_C({value + 1}) - 1" if value == -(2**63) else f"INT64_C({value})"
    if isnan(value):
        return "NAN"
    return float(value).hex() if isfinite(value) else f"{'-' if value < 0 else ''}INFINITY"


def _table(lookup: Expression) -> tuple[str, str]:
    """The type of a table's numbers, and the numbers."""
    if lookup.dtype is torch.bool:
        entries = ", ".join(str(int(entry)) for entry in lookup.args[0])
    else:
        entries = ", ".join(_literal(entry, lookup.dtype) for entry in lookup.args[0])
    return _NUMBERS[lookup.dtype], f"{{{entries}}}"


def _place(leaf: int, element: int, lane: int = 0) -> str:
    return f"leaf_{leaf}[{element}]"


def _loads(number: int, leaf: Leaf) -> Iterable[str]:
    size = len(leaf.elements)
    yield f"{_TYPES[leaf.dtype]} leaf_{number}[{size}];"
    yield f"for (int e = 0; e < {size}; ++e)"
    yield (f"    load<{_NUMBERS[leaf.dtype]}>(leaf_{number}[e], leaf[{number}], e * lanes + lane);")
    if leaf.dtype is torch.bool:
        yield f"for (mask& each : leaf_{number}) each = -each;"


def _stores(number: int, leaf: Leaf, changes: Mapping[Expression, Expression]) -> Iterable[str]:
    sign = "-" if leaf.dtype is torch.bool else ""
    for element, value in enumerate(leaf.elements):
        if value in changes:
            yield (
                f"store<{_NUMBERS[leaf.dtype]}>({sign}{_place(number, element)}, "
                f"leaf[{number}], {element} * lanes + lane);"
            )


def _lines(indent: int, lines: Iterable[str]) -> str:
    return "\n".join(" " * indent + line for line in lines)
