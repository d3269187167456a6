import itertools
import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from fnnq_torchrl.equations.membership_functions import MEMBERSHIP_FUNCTIONS, T_NORMS


def straight(x: float, *corners: tuple[float, float]) -> float:
    """Through the corners, with straight lines between."""
    for (x0, y0), (x1, y1) in itertools.pairwise(corners):
        if x0 <= x <= x1 and x0 < x1:
            return y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    return 0.0


ORACLES: dict[str, Callable[..., float]] = {
    "gaussian": lambda x, c, w: math.exp(-((x - c) ** 2) / (2 * w * w)),
    "triangle": lambda x, a, b, c: straight(x, (a, 0), (b, 1), (c, 0)),
    "trapezoid": lambda x, a, b, c, d: straight(x, (a, 0), (b, 1), (c, 1), (d, 0)),
    "bell": lambda x, c, w, s: 1 / (1 + abs((x - c) / w) ** (2 * s)),
    "sigmoid": lambda x, i, s: 1 / (1 + math.exp(-s * (x - i))),
    "gaussian_two_sided": lambda x, a, v, b, w: (
        math.exp(-((x - a) ** 2) / (2 * v * v))
        if x < a
        else math.exp(-((x - b) ** 2) / (2 * w * w))
        if x > b
        else 1.0
    ),
}

PARAMETERS = {
    "gaussian": (-0.5, 0.4),
    "triangle": (-0.5, 0.1, 0.5),
    "trapezoid": (-0.5, -0.1, 0.1, 0.7),
    "bell": (0.2, 0.3, 2.5),
    "sigmoid": (0.1, -8.0),
    "gaussian_two_sided": (-0.2, 0.1, 0.3, 0.5),
}


def call(formula: Callable[..., torch.Tensor], x: float, *parameters: float) -> float:
    return float(formula(*(torch.tensor(value, dtype=torch.float64) for value in (x, *parameters))))


@pytest.mark.parametrize("name", MEMBERSHIP_FUNCTIONS)
@given(x=st.floats(-3, 3))
@settings(max_examples=15)
def test_each_is_its_closed_form_and_the_logarithm_is_its_logarithm(name: str, x: float) -> None:
    kind, parameters = MEMBERSHIP_FUNCTIONS[name], PARAMETERS[name]
    degree = call(kind.degree, x, *parameters)
    assert degree == pytest.approx(ORACLES[name](x, *parameters), rel=1e-9, abs=1e-12)
    assert math.exp(call(kind.log_degree, x, *parameters)) == pytest.approx(degree, abs=1e-12)
    low, high = kind.support(parameters)
    assert (degree == 0) == (not low < x < high)


@pytest.mark.parametrize("name", sorted(set(MEMBERSHIP_FUNCTIONS) - {"triangle", "trapezoid"}))
@pytest.mark.parametrize("x", [-1e8, 1e8])
def test_far_away_the_logarithm_stays_a_number(name: str, x: float) -> None:
    log_degree = call(MEMBERSHIP_FUNCTIONS[name].log_degree, x, *PARAMETERS[name])
    assert -math.inf < log_degree <= 0


def test_vertical_sides_belong_to_the_label() -> None:
    triangle, trapezoid = (MEMBERSHIP_FUNCTIONS[name].degree for name in ("triangle", "trapezoid"))
    assert [call(triangle, x, 0, 0, 1) for x in (-0.1, 0, 0.25, 1)] == [0, 1, 0.75, 0]
    assert [call(triangle, x, 0, 1, 1) for x in (0, 0.25, 1, 1.1)] == [0, 0.25, 1, 0]
    assert [call(trapezoid, x, 0, 0, 1, 1) for x in (-0.1, 0, 0.5, 1, 1.1)] == [0, 1, 1, 1, 0]


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("gaussian", (0.0,), r"2 finite numbers \[centre, width\]"),
        ("gaussian", (0.0, math.inf), "finite"),
        ("gaussian", (0.0, 0.0), "width > 0"),
        ("triangle", (0.0, 2.0, 1.0), "a <= b <= c and a < c"),
        ("triangle", (1.0, 1.0, 1.0), "a < c"),
        ("trapezoid", (0.0, 2.0, 1.0, 3.0), "a <= b <= c <= d"),
        ("bell", (0.0, 1.0, -1.0), "slope > 0"),
        ("gaussian_two_sided", (1.0, 1.0, 0.0, 1.0), "left <= right"),
    ],
)
def test_parameters_that_make_no_label_are_told(
    name: str, parameters: tuple[float, ...], words: str
) -> None:
    with pytest.raises(AssertionError, match=words):
        raise AssertionError(MEMBERSHIP_FUNCTIONS[name].misfit(parameters))


@pytest.mark.parametrize("name", MEMBERSHIP_FUNCTIONS)
def test_parameters_that_do_fit(name: str) -> None:
    kind = MEMBERSHIP_FUNCTIONS[name]
    assert kind.misfit(PARAMETERS[name]) is None
    assert sorted(kind.fis_order) == list(range(len(kind.parameters)))


@pytest.mark.parametrize("name", T_NORMS)
@given(a=st.floats(0, 1), b=st.floats(0, 1), c=st.floats(0, 1))
@settings(max_examples=10)
def test_t_norms(name: str, a: float, b: float, c: float) -> None:
    """Commutative, monotone, with 1 as the neutral element, and never above either degree."""
    combine = T_NORMS[name].combine
    assert call(combine, a, b) == call(combine, b, a)
    assert call(combine, a, 1) == a
    assert call(combine, a, b) <= min(a, b)
    assert call(combine, min(a, c), b) <= call(combine, max(a, c), b)
