"""Write a step as a C++ program, a loop of steps on one vector of lanes at a time."""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite, isnan
from string import Template

import torch

from .errors import Unsupported
from .expressions import COMPARISONS, FUNCTIONS, VECTORISED, Expression
from .prelude import DECLARATION, PRELUDE, RUN
from .statements import INFIX, Language, Leaf, Rows, Statements, leaf_name

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
_COMPARISONS = dict(zip(COMPARISONS, ("==", "!=", "<", "<=", ">", ">="), strict=True))
_PREFIX = {"neg": "-", "bitwise_not": "~", "copy": ""}
_CALLS = ("where", "maximum", "minimum")
_LIMITS = {"maximum": "at_least", "minimum": "at_most"}  # for a constant second operand

_SMALL = 64
"""The most vectors of an array on the stack; larger arrays are on the heap."""


def program(leaves: Sequence[Leaf], over: int | None = None) -> str:
    """Return the text of a C++ program with one function, ``run(lanes, steps, leaves)``.

    The function changes the leaves in place, each ``[elements, lanes]``.

    Args:
        leaves: the tensors, in the order in which the function takes them.
        over: the number of the boolean leaf that marks finished lanes, if there is one.

    Raises:
        Unsupported: if an operation has no translation.
    """
    statements = Statements.of(Cpp(), leaves)
    real = torch.float64 if any(leaf.dtype is torch.float64 for leaf in leaves) else torch.float32
    body = [*statements.body()]
    if over is not None:
        body = [f"if (everywhere({leaf_name(over)}[0])) break;", *body]
    prelude = Template(PRELUDE).substitute(
        real=_NUMBERS[real], mask="i64" if real is torch.float64 else "i32"
    )
    vectorised = {_declaration(value) for value in statements.every if value.op in VECTORISED}
    changed = statements.changed
    arrays = {leaf_name(n): (leaf.dtype, leaf.size) for n, leaf in enumerate(leaves)}
    arrays |= statements.arrays()
    large = {name: of for name, of in arrays.items() if of[1] > _SMALL}
    small = {name: of for name, of in arrays.items() if of[1] <= _SMALL}
    rows = statements.rows()
    run = Template(RUN).substitute(
        memory=_lines(4, [*_declared(large), *(f"Rows<{n}> {name};" for name, n in rows.items())]),
        constants=_lines(4, statements.constants()),
        arrays=_lines(
            8,
            [
                *_declared(small),
                *(f"auto& {name} = memory->{name};" for name in [*large, *rows]),
                *(f"{name}.wake_all();" for name in rows),
            ],
        ),
        loads=_lines(8, (line for n, leaf in enumerate(leaves) for line in _loads(n, leaf))),
        once=_lines(8, statements.once()),
        body=_lines(12, body),
        stores=_lines(
            8, (line for n, leaf in enumerate(leaves) if n in changed for line in _stores(n, leaf))
        ),
    )
    return "\n".join([prelude, *sorted(vectorised), *statements.tables(), run])


class Cpp(Language):
    """C++ with compiler extensions: every value is a vector of lanes (:mod:`.prelude`)."""

    index_type = "int64_t"  # an int would be widened to an address in each iteration

    def literal(self, number: float, dtype: torch.dtype) -> str:
        if dtype is torch.bool:
            return "-1" if number else "0"
        if not dtype.is_floating_point:
            # C++ has no literal for the least 64-bit integer.
            return f"INT64_C({number + 1}) - 1" if number == -(2**63) else f"INT64_C({number})"
        if isnan(number):
            return "NAN"
        if isfinite(number):
            return float(number).hex()
        return f"{'-' if number < 0 else ''}INFINITY"

    def same(self, literal: str, dtype: torch.dtype) -> str:
        return f"all<{_TYPES[dtype]}>({literal})"

    def define(self, dtype: torch.dtype, name: str, formula: str) -> str:
        return f"const {_TYPES[dtype]} {name} = {formula};"

    def declare(self, dtype: torch.dtype, name: str, first: str) -> str:
        return f"{_TYPES[dtype]} {name} = {first};"

    def table(self, dtype: torch.dtype, name: str, entries: Sequence[str]) -> str:
        numbers = ", ".join(entries)
        if dtype is torch.bool:
            numbers = numbers.replace("-", "")
        return f"const {_NUMBERS[dtype]} {name}[] = {{{numbers}}};"

    def entry(self, dtype: torch.dtype, table: str, index: str) -> str:
        sign = "-" if dtype is torch.bool else ""
        return self.same(f"{sign}{table}[{index}]", dtype)

    def lookup(self, dtype: torch.dtype, table: str, index: str) -> str:
        sign = "-" if dtype is torch.bool else ""
        return f"{sign}lookup<{_TYPES[dtype]}>({table}, {index})"

    def pick(self, array: str, first: str, stride: int, index: str) -> str:
        return f"pick(&{array}[{first}], {stride}, {index})"

    def anywhere(self, mask: str) -> str:
        return f"anywhere({mask})"

    def awake(self, rows: Rows) -> Iterable[str]:
        for index in rows.visits:
            yield f"{rows.name}.wake({index});"
        conditions = [f"finite({number})" for number in rows.finite]
        conditions += [f"positive({number})" for number in rows.positive]
        if conditions:
            yield f"if (!everywhere({' & '.join(conditions)})) {rows.name}.wake_all();"
        yield f"for (int n = {rows.name}.first(); n < {rows.name}.number; ++n) {{"
        yield f"    const int64_t row = {rows.name}.of[n];"
        size = 1
        for axis in rows.axes[::-1]:
            yield f"    const int64_t i{axis.number} = row / {size} % {axis.size};"
            size *= axis.size
        yield from (f"    {line}" for line in rows.body)
        zeros = " | ".join(f"bits({number})" for number in rows.traces)
        conditions = [f"anywhere({zeros})"]
        if rows.weights:
            masks = " | ".join(f"negative_zero({number})" for number in rows.weights)
            conditions.append(f"anywhere({masks})")
        yield f"    {rows.name}.next(row, {' || '.join(conditions)});"
        yield "}"
        yield f"{rows.name}.last();"

    def formula(self, op: str, value: Expression, operands: Sequence[str]) -> str:
        if op in INFIX:
            return f" {INFIX[op]} ".join(operands)
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
        if op == "cast":
            return _cast(value.operands[0].dtype, value.dtype, operands[0])
        raise Unsupported(f"no translation for {op}")


def _is_number(value: Expression) -> bool:
    return value.op == "constant" and value.args[0] == value.args[0]


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
    return Template(DECLARATION).substitute(number=number, function=function)


def _loads(number: int, leaf: Leaf) -> Iterable[str]:
    name = leaf_name(number)
    yield f"for (int e = 0; e < {leaf.size}; ++e)"
    yield f"    load<{_NUMBERS[leaf.dtype]}>({name}[e], leaf[{number}], e * lanes + lane);"
    if leaf.dtype is torch.bool:
        yield f"for (mask& each : {name}) each = -each;"


def _stores(number: int, leaf: Leaf) -> Iterable[str]:
    sign = "-" if leaf.dtype is torch.bool else ""
    yield f"for (int e = 0; e < {leaf.size}; ++e)"
    yield (
        f"    store<{_NUMBERS[leaf.dtype]}>({sign}{leaf_name(number)}[e], leaf[{number}], "
        "e * lanes + lane);"
    )


def _lines(indent: int, lines: Iterable[str]) -> str:
    return "\n".join(" " * indent + line for line in lines)
