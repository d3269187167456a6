"""Expressions are simplified only where no bit of any result changes."""

import torch

from fnnq_torchrl.engine.native.expressions import Expressions

F32, I64, BOOL = torch.float32, torch.int64, torch.bool


def test_equal_expressions_are_one() -> None:
    make = Expressions(100)
    x, y = make.input(0, 0, 0, F32), make.input(0, 1, 0, F32)
    assert make.input(0, 0, 0, F32) is x
    assert x is not y
    assert make("mul", F32, x, y) is make("mul", F32, x, y)
    assert make("mul", F32, x, y) is not make("mul", F32, y, x)  # the order may matter to a NaN
    assert make.lookup((1.0, 2.0), x, F32) is not make.lookup((1.0, 3.0), x, F32)


def test_constants_are_what_their_dtype_can_hold() -> None:
    make = Expressions(100)
    assert make.constant(0.1, F32).args[0] == torch.tensor(0.1).item()
    assert make.constant(2.7, I64).args[0] == 2
    assert make.constant(3, BOOL).args[0] is True
    assert make.constant(0.0, F32) is not make.constant(-0.0, F32)
    assert make.constant(torch.nan, F32) is make.constant(torch.nan, F32)
    assert make.constant(2**63 - 1, I64).args[0] == 2**63 - 1


def test_neutral_elements_are_dropped() -> None:
    make = Expressions(100)
    x, n, p = make.input(0, 0, 0, F32), make.input(1, 0, 0, I64), make.input(2, 0, 0, BOOL)
    one, zero = make.constant(1, F32), make.constant(0, F32)
    assert make("mul", F32, x, one) is make("mul", F32, one, x) is x
    assert make("div", F32, x, one) is make("sub", F32, x, zero) is x
    nothing = make.constant(0, I64)
    assert make("add", I64, n, nothing) is make("add", I64, nothing, n) is n
    assert make("where", F32, p, x, x) is x
    assert make("where", F32, make.constant(True, BOOL), x, one) is x
    assert make("where", F32, make.constant(False, BOOL), one, x) is x
    assert make.cast(x, F32) is x
    assert make.cast(make.constant(2, I64), F32) is make.constant(2.0, F32)


def test_what_would_change_a_bit_stays() -> None:
    make = Expressions(100)
    x, zero, one = make.input(0, 0, 0, F32), make.constant(0, F32), make.constant(1, F32)
    assert make("add", F32, x, zero) is not x  # −0.0 + 0.0 is 0.0
    assert make("mul", F32, x, zero) is not zero  # NaN · 0 is NaN
    assert make("div", F32, one, x) is not x
    assert make("sub", F32, zero, x) is not x
    assert make("sub", F32, x, make.constant(-0.0, F32)) is not x  # −0.0 − −0.0 is 0.0
    wide = make.constant(2**40 + 5, I64)
    assert make.cast(make.cast(wide, torch.int32), I64).args[0] == 5


def test_what_is_constant_is_computed_at_once() -> None:
    make = Expressions(100)
    one, other = make.constant(0.1, F32), make.constant(0.2, F32)
    assert make("add", F32, one, other) is make.constant((torch.tensor(0.1) + 0.2).item(), F32)
    assert make("sin", F32, one).op == "sin"  # is not the same on every machine
    # The program counts numbers that are too small for all their digits as zero.
    assert make("mul", F32, make.constant(1e-30, F32), make.constant(1e-10, F32)).op == "mul"
    assert make("add", F32, make.constant(1e-39, F32), one).op == "add"


def test_a_choice_of_positive_numbers_is_its_own_absolute_value() -> None:
    make = Expressions(100)
    p, one, zero = make.input(0, 0, 0, BOOL), make.constant(1, F32), make.constant(0, F32)
    choice = make("where", F32, p, one, zero)
    assert make("abs", F32, choice) is choice
    negative = make("where", F32, p, one, make.constant(-0.0, F32))
    assert make("abs", F32, negative) is not negative


def test_tables_are_told_apart_by_every_bit() -> None:
    make = Expressions(100)
    index = make.input(0, 0, 0, I64)
    assert make.lookup((0.0, 1.0), index, F32) is not make.lookup((-0.0, 1.0), index, F32)


def test_of_booleans_sums_and_products_are_or_and_and() -> None:
    make = Expressions(100)
    p, q = make.input(0, 0, 0, BOOL), make.input(0, 1, 0, BOOL)
    assert make("add", BOOL, p, q).op == make("maximum", BOOL, p, q).op == "bitwise_or"
    assert make("mul", BOOL, p, q).op == make("minimum", BOOL, p, q).op == "bitwise_and"
    assert all(operand.dtype is torch.int32 for operand in make("lt", BOOL, p, q).operands)
