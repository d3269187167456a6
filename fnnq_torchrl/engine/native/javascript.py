"""Write a step as a JavaScript module, which computes one step of a single run at a time.

Pages that play a learned policy use the module: the browser evaluates the same expressions as the
C++ program. 32-bit real numbers are rounded after every operation; 64-bit integers are BigInts.
Exponentials, sines and similar functions are the browser's, whose last digit may differ from
torch's.
"""

from collections.abc import Sequence
from math import inf, isnan
from string import Template

import torch

from .errors import Unsupported
from .expressions import COMPARISONS, Expression
from .statements import INFIX, Language, Leaf, Statements, leaf_name

ARRAYS = {
    torch.float32: "Float32Array",
    torch.float64: "Float64Array",
    torch.int32: "Int32Array",
    torch.int64: "BigInt64Array",
    torch.bool: "Int8Array",
}
"""The classes of the leaves' arrays. A boolean is 0 or -1."""

_COMPARISONS = dict(zip(COMPARISONS, ("===", "!==", "<", "<=", ">", ">="), strict=True))
_FUNCTIONS = {name: f"Math.{name}" for name in ("abs", "ceil", "floor", "sqrt", "trunc")}
_FUNCTIONS |= {name: f"Math.{name}" for name in ("acos", "asin", "atan", "atan2", "cos", "cosh")}
_FUNCTIONS |= {name: f"Math.{name}" for name in ("exp", "expm1", "log", "log1p", "pow", "sin")}
_FUNCTIONS |= {name: f"Math.{name}" for name in ("sinh", "tan", "tanh")}
_FUNCTIONS |= {"round": "toEven"}

_MODULE = """\
const asInt = (x) => BigInt.asIntN(64, x);
function toEven(x) {
    const low = Math.floor(x), rest = x - low;
    return rest < 0.5 || (rest === 0.5 && low % 2 === 0) ? low : low + 1;
}
$tables
$arrays
// Computes one step of the run. Changes the leaves, an array of typed arrays, in place.
export function step(leaf) {
$leaves
$constants
$once
$body
}
"""


class JavaScript(Language):
    """JavaScript, which computes on a single lane."""

    index_type = "let"

    def literal(self, number: float, dtype: torch.dtype) -> str:
        if dtype is torch.bool:
            return "-1" if number else "0"
        if not dtype.is_floating_point:
            return f"{number}n" if dtype is torch.int64 else str(number)
        if isnan(number):
            return "NaN"
        if abs(number) == inf:
            return "Infinity" if number > 0 else "-Infinity"
        return repr(float(number))

    def same(self, literal: str, dtype: torch.dtype) -> str:
        return literal

    def define(self, dtype: torch.dtype, name: str, formula: str) -> str:
        return f"const {name} = {formula};"

    def declare(self, dtype: torch.dtype, name: str, first: str) -> str:
        return f"let {name} = {first};"

    def table(self, dtype: torch.dtype, name: str, entries: Sequence[str]) -> str:
        return f"const {name} = [{', '.join(entries)}];"

    def entry(self, dtype: torch.dtype, table: str, index: str) -> str:
        return f"{table}[{index}]"

    def lookup(self, dtype: torch.dtype, table: str, index: str) -> str:
        return f"{table}[{index}]"

    def pick(self, array: str, first: str, stride: int, index: str) -> str:
        return f"{array}[{first} + {stride} * Number({index})]"

    def anywhere(self, mask: str) -> str:
        return mask

    def formula(self, op: str, value: Expression, operands: Sequence[str]) -> str:
        dtype = value.dtype
        if op in _COMPARISONS:
            return f"({f' {_COMPARISONS[op]} '.join(operands)} ? -1 : 0)"
        if op == "where":
            which, chosen, other = operands
            return f"({which} ? {chosen} : {other})"
        if op == "copy":
            return operands[0]
        if op == "cast":
            return _cast(value.operands[0].dtype, dtype, operands[0])
        if op in ("maximum", "minimum"):
            return _extreme(op, dtype, operands)
        if op in ("neg", "bitwise_not"):
            return _rounded(dtype, f"{'-' if op == 'neg' else '~'}{operands[0]}")
        if op == "mul" and dtype is torch.int32:
            return f"Math.imul({', '.join(operands)})"
        if op in INFIX:
            one, other = operands
            return _rounded(dtype, f"{one} {INFIX[op]} {other}")
        if op == "fmod":
            return _rounded(dtype, " % ".join(operands))
        if op in _FUNCTIONS and dtype.is_floating_point:
            return _rounded(dtype, f"{_FUNCTIONS[op]}({', '.join(operands)})")
        raise Unsupported(f"no translation to JavaScript for {op}")


def module(leaves: Sequence[Leaf]) -> str:
    """Return the text of a JavaScript module that exports ``step(leaf)``.

    The function changes the leaves in place. Each leaf is a typed array (:data:`ARRAYS`) with the
    elements of one lane in row-major order.

    Args:
        leaves: the tensors and their new values, in the order of the function's array.

    Raises:
        Unsupported: if an operation has no translation.
    """
    statements = Statements.of(JavaScript(), leaves)
    arrays = [
        f"const {n} = new {ARRAYS[of]}({size});" for n, (of, size) in statements.arrays().items()
    ]
    return Template(_MODULE).substitute(
        tables="\n".join(statements.tables()),
        arrays="\n".join(arrays),
        leaves="\n".join(f"    const {leaf_name(n)} = leaf[{n}];" for n in range(len(leaves))),
        constants="\n".join(f"    {line}" for line in statements.constants()),
        once="\n".join(f"    {line}" for line in statements.once()),
        body="\n".join(f"    {line}" for line in statements.body()),
    )


def _rounded(dtype: torch.dtype, formula: str) -> str:
    """Write the rounding of a real result, or the wrapping of a whole one, to its dtype."""
    if dtype is torch.float32:
        return f"Math.fround({formula})"
    if dtype is torch.float64:
        return f"({formula})"
    return f"asInt({formula})" if dtype is torch.int64 else f"(({formula}) | 0)"


def _extreme(op: str, dtype: torch.dtype, operands: Sequence[str]) -> str:
    if dtype is not torch.int64:  # keeps NaN, as torch does
        return f"Math.{op[:3]}({', '.join(operands)})"
    one, other = operands
    return f"({one} {'>' if op == 'maximum' else '<'} {other} ? {one} : {other})"


def _cast(of: torch.dtype, to: torch.dtype, operand: str) -> str:
    zero = "0n" if of is torch.int64 else "0"
    if to is torch.bool:
        return f"({operand} !== {zero} ? -1 : 0)"
    if of is torch.bool:
        operand, of = f"({operand} ? 1 : 0)", torch.int32
    if to is torch.int64:
        whole = f"Math.trunc({operand})" if of.is_floating_point else operand
        return f"BigInt({whole})"
    if of is torch.int64:
        operand = f"Number({f'BigInt.asIntN(32, {operand})' if to is torch.int32 else operand})"
    return _rounded(to, operand)
