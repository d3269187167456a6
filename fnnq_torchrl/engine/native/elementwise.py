"""Element-by-element operations."""

from functools import partial
from math import isfinite
from typing import Any

import torch

from .arrays import Array, each
from .call import Call, Operations
from .errors import Unsupported
from .expressions import FUNCTIONS

aten = torch.ops.aten

OPERATIONS = Operations()

_ELEMENTARY = ("bitwise_and", "bitwise_not", "bitwise_or", "bitwise_xor", "maximum", "minimum")
for _name in (*FUNCTIONS, *_ELEMENTARY, "mul", "neg"):
    OPERATIONS.register(getattr(aten, _name))(partial(Call.pointwise, op=_name))
for _packet, _name in {
    aten.__and__: "bitwise_and",
    aten.__or__: "bitwise_or",
    aten.__xor__: "bitwise_xor",
    aten.logical_and: "bitwise_and",
    aten.logical_or: "bitwise_or",
    aten.logical_xor: "bitwise_xor",
    aten.logical_not: "bitwise_not",
}.items():
    OPERATIONS.register(_packet)(partial(Call.pointwise, op=_name))


@OPERATIONS.register(
    aten.__lshift__, aten.__rshift__, aten.bitwise_left_shift, aten.bitwise_right_shift
)
def _shift(call: Call, values: Array, by: Array | int) -> Array:
    if not isinstance(by, int) or not 0 <= by < 8 * call.result.dtype.itemsize:
        raise Unsupported("no translation for shifts by a number that isn't constant")
    left = call.packet in (aten.__lshift__, aten.bitwise_left_shift)
    return call.pointwise(values, by, op="lshift" if left else "rshift")


@OPERATIONS.register(aten.eq, aten.ne, aten.lt, aten.le, aten.gt, aten.ge)
def _compare(call: Call, left: Array, right: Array | float) -> Array:
    computed_in = torch.result_type(*call.args)
    return call.pointwise(left, right, op=call.packet.__name__, computed_in=computed_in)


@OPERATIONS.register(aten.isnan)
def _isnan(call: Call, values: Array) -> Array:
    return call.pointwise(values, values, op="ne", computed_in=call.args[0].dtype)


@OPERATIONS.register(aten.add, aten.sub)
def _add(call: Call, left: Array, right: Array | float, *, alpha: float = 1) -> Array:
    scaled = right if alpha == 1 else call.pointwise(right, alpha, op="mul")
    return call.pointwise(left, scaled, op=call.packet.__name__)


@OPERATIONS.register(aten.div)
def _div(
    call: Call, left: Array, right: Array | float, *, rounding_mode: str | None = None
) -> Array:
    if rounding_mode is not None:
        raise Unsupported("no translation for division with a rounding mode")
    return call.pointwise(left, right, op="div")


@OPERATIONS.register(aten.remainder)
def _remainder(call: Call, left: Array | float, right: Array | float) -> Array:
    """The remainder, with the sign of the divisor, as in Python."""
    if not call.result.dtype.is_floating_point:
        raise Unsupported("no translation for the remainder of whole numbers")
    if not isinstance(right, int | float) or not isfinite(right):
        raise Unsupported("no translation for the remainder by a number that isn't constant")
    quotient = call.pointwise(call.pointwise(left, right, op="div"), op="floor")
    rest = call.pointwise(left, call.pointwise(quotient, right, op="mul"), op="sub")
    # Corrects a quotient that rounding has made too large by one.
    signs = call.pointwise(rest, right, op="mul")
    zero = call.make.constant(0, call.result.dtype)
    below = each(lambda sign: call.make("lt", torch.bool, sign, zero), signs)
    return _where(call, below, call.pointwise(rest, right, op="add"), rest)


@OPERATIONS.register(aten.abs)
def _abs(call: Call, values: Array) -> Array:
    if call.result.dtype.is_floating_point:
        return call.pointwise(values, op="abs")
    return call.pointwise(values, call.pointwise(values, op="neg"), op="maximum")


@OPERATIONS.register(aten.isinf)
def _isinf(call: Call, values: Array) -> Array:
    dtype = call.args[0].dtype
    size = each(lambda value: call.make("abs", dtype, value), call.cast(values, dtype))
    return call.pointwise(size, float("inf"), op="eq", computed_in=dtype)


@OPERATIONS.register(aten.reciprocal)
def _reciprocal(call: Call, values: Array) -> Array:
    return call.pointwise(1, values, op="div")


@OPERATIONS.register(aten.rsqrt)
def _rsqrt(call: Call, values: Array) -> Array:
    return call.pointwise(1, call.pointwise(values, op="sqrt"), op="div")


@OPERATIONS.register(aten.sigmoid)
def _sigmoid(call: Call, values: Array) -> Array:
    negated = call.pointwise(call.pointwise(values, op="neg"), op="exp")
    return call.pointwise(1, call.pointwise(1, negated, op="add"), op="div")


@OPERATIONS.register(aten.sign)
def _sign(call: Call, values: Array) -> Array:
    dtype = call.result.dtype
    above, below = (
        each(
            lambda value, op=op: call.make(op, torch.bool, value, call.make.constant(0, dtype)),
            values,
        )
        for op in ("gt", "lt")
    )
    return call.pointwise(above, below, op="sub")


@OPERATIONS.register(aten.relu)
def _relu(call: Call, values: Array) -> Array:
    return call.pointwise(values, 0, op="maximum")


@OPERATIONS.register(aten.pow)
def _pow(call: Call, base: Array | float, exponent: Array | float) -> Array:
    if isinstance(exponent, int | float):
        if exponent == 0.5:
            return call.pointwise(base, op="sqrt")
        if exponent == -1:
            return call.pointwise(1, base, op="div")
        if exponent in (2, 3):
            square = call.pointwise(base, base, op="mul")
            return square if exponent == 2 else call.pointwise(square, base, op="mul")
    if not call.result.dtype.is_floating_point:
        raise Unsupported("no translation for powers of whole numbers")
    return call.pointwise(base, exponent, op="pow")


@OPERATIONS.register(aten.clamp)
def _clamp(
    call: Call,
    values: Array,
    low: Array | float | None = None,
    high: Array | float | None = None,
) -> Array:
    if low is not None:
        values = call.pointwise(values, low, op="maximum")
    return values if high is None else call.pointwise(values, high, op="minimum")


@OPERATIONS.register(aten.where)
def _where(call: Call, mask: Array, chosen: Array | float, other: Array | float) -> Array:
    dtype = call.result.dtype
    return each(
        lambda *values: call.make("where", dtype, *values),
        mask,
        call.cast(chosen, dtype),
        call.cast(other, dtype),
    )


@OPERATIONS.register(aten._to_copy)
def _to_copy(call: Call, values: Array, **_: Any) -> Array:
    return call.cast(values, call.result.dtype)


@OPERATIONS.register(aten.clone, aten.alias, aten.detach, aten.lift_fresh_copy)
def _clone(call: Call, values: Array, **_: Any) -> Array:
    return values
