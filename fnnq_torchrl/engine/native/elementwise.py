"""Operations on each element on its own."""

from functools import partial
from math import isfinite
from typing import Any

import torch

from .executor import Array, Executor, each, operation
from .expressions import Unsupported
from .source import FUNCTIONS

aten = torch.ops.aten

_ELEMENTARY = ("bitwise_and", "bitwise_not", "bitwise_or", "bitwise_xor", "maximum", "minimum")
for _name in (*FUNCTIONS, *_ELEMENTARY, "mul", "neg"):
    operation(getattr(aten, _name))(partial(Executor.pointwise, op=_name))
for _packet, _name in {
    aten.__and__: "bitwise_and",
    aten.__or__: "bitwise_or",
    aten.__xor__: "bitwise_xor",
    aten.logical_and: "bitwise_and",
    aten.logical_or: "bitwise_or",
    aten.logical_xor: "bitwise_xor",
    aten.logical_not: "bitwise_not",
}.items():
    operation(_packet)(partial(Executor.pointwise, op=_name))


@operation(aten.__lshift__, aten.__rshift__, aten.bitwise_left_shift, aten.bitwise_right_shift)
def _shift(run: Executor, values: Array, by: Array | int) -> Array:
    if not isinstance(by, int) or not 0 <= by < 8 * run.result.dtype.itemsize:
        raise Unsupported("no translation for shifts by what isn't known")
    left = run.packet in (aten.__lshift__, aten.bitwise_left_shift)
    return run.pointwise(values, by, op="lshift" if left else "rshift")


@operation(aten.eq, aten.ne, aten.lt, aten.le, aten.gt, aten.ge)
def _compare(run: Executor, left: Array, right: Array | float) -> Array:
    computed_in = torch.result_type(*run.likes)
    return run.pointwise(left, right, op=run.packet.__name__, computed_in=computed_in)


@operation(aten.isnan)
def _isnan(run: Executor, values: Array) -> Array:
    return run.pointwise(values, values, op="ne", computed_in=run.likes[0].dtype)


@operation(aten.add, aten.sub)
def _add(run: Executor, left: Array, right: Array | float, *, alpha: float = 1) -> Array:
    scaled = right if alpha == 1 else run.pointwise(right, alpha, op="mul")
    return run.pointwise(left, scaled, op=run.packet.__name__)


@operation(aten.div)
def _div(
    run: Executor, left: Array, right: Array | float, *, rounding_mode: str | None = None
) -> Array:
    if rounding_mode is None:
        return run.pointwise(left, right, op="div")
    if rounding_mode == "floor" or not run.result.dtype.is_floating_point:
        raise Unsupported("no translation for division with a rest")
    return run.pointwise(run.pointwise(left, right, op="div"), op="trunc")


@operation(aten.remainder)
def _remainder(run: Executor, left: Array | float, right: Array | float) -> Array:
    """With the sign of the divisor, as in Python."""
    if not run.result.dtype.is_floating_point:
        raise Unsupported("no translation for the division of whole numbers")
    if not isinstance(right, int | float) or not isfinite(right):
        raise Unsupported("no translation for the rest of a division by what isn't known")
    quotient = run.pointwise(run.pointwise(left, right, op="div"), op="floor")
    rest = run.pointwise(left, run.pointwise(quotient, right, op="mul"), op="sub")
    # Where rounding has made the quotient too large by one.
    signs = run.pointwise(rest, right, op="mul")
    zero = run.make.constant(0, run.result.dtype)
    below = each(lambda sign: run.make("lt", torch.bool, sign, zero), signs)
    return _where(run, below, run.pointwise(rest, right, op="add"), rest)


@operation(aten.abs)
def _abs(run: Executor, values: Array) -> Array:
    if run.result.dtype.is_floating_point:
        return run.pointwise(values, op="abs")
    return run.pointwise(values, run.pointwise(values, op="neg"), op="maximum")


@operation(aten.isinf)
def _isinf(run: Executor, values: Array) -> Array:
    dtype = run.likes[0].dtype
    size = each(lambda value: run.make("abs", dtype, value), run.cast(values, dtype))
    return run.pointwise(size, float("inf"), op="eq", computed_in=dtype)


@operation(aten.reciprocal)
def _reciprocal(run: Executor, values: Array) -> Array:
    return run.pointwise(1, values, op="div")


@operation(aten.rsqrt)
def _rsqrt(run: Executor, values: Array) -> Array:
    return run.pointwise(1, run.pointwise(values, op="sqrt"), op="div")


@operation(aten.sigmoid)
def _sigmoid(run: Executor, values: Array) -> Array:
    negated = run.pointwise(run.pointwise(values, op="neg"), op="exp")
    return run.pointwise(1, run.pointwise(1, negated, op="add"), op="div")


@operation(aten.sign)
def _sign(run: Executor, values: Array) -> Array:
    dtype = run.result.dtype
    above, below = (
        each(
            lambda value, op=op: run.make(op, torch.bool, value, run.make.constant(0, dtype)),
            values,
        )
        for op in ("gt", "lt")
    )
    return run.pointwise(above, below, op="sub")


@operation(aten.relu)
def _relu(run: Executor, values: Array) -> Array:
    return run.pointwise(values, 0, op="maximum")


@operation(aten.pow)
def _pow(run: Executor, base: Array | float, exponent: Array | float) -> Array:
    if isinstance(exponent, int | float):
        if exponent == 0.5:
            return run.pointwise(base, op="sqrt")
        if exponent == -1:
            return run.pointwise(1, base, op="div")
        if exponent in (2, 3):
            square = run.pointwise(base, base, op="mul")
            return square if exponent == 2 else run.pointwise(square, base, op="mul")
    if not run.result.dtype.is_floating_point:
        raise Unsupported("no translation for powers of whole numbers")
    return run.pointwise(base, exponent, op="pow")


@operation(aten.clamp)
def _clamp(
    run: Executor,
    values: Array,
    low: Array | float | None = None,
    high: Array | float | None = None,
) -> Array:
    if low is not None:
        values = run.pointwise(values, low, op="maximum")
    return values if high is None else run.pointwise(values, high, op="minimum")


@operation(aten.where)
def _where(run: Executor, mask: Array, chosen: Array | float, other: Array | float) -> Array:
    dtype = run.result.dtype
    return each(
        lambda *values: run.make("where", dtype, *values),
        mask,
        run.cast(chosen, dtype),
        run.cast(other, dtype),
    )


@operation(aten._to_copy)
def _to_copy(run: Executor, values: Array, **_: Any) -> Array:
    return run.cast(values, run.result.dtype)


@operation(aten.clone, aten.alias, aten.detach, aten.lift_fresh_copy)
def _clone(run: Executor, values: Array, **_: Any) -> Array:
    return values
