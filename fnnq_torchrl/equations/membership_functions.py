"""Registries of membership functions and t-norms: formulas, parameters and names in file formats.

The formulas use methods of tensors only, so this module doesn't import torch. A configuration can
thus be checked against the registries before torch is loaded. The formulas work element by element
in the dtype of their arguments.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, log, sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

Formula = Callable[..., "Tensor"]
"""``formula(x, *parameters)`` of tensors that broadcast with each other."""


def _rise(x: "Tensor", start: "Tensor", end: "Tensor") -> "Tensor":
    """Rise linearly from 0 at ``start`` to 1 at ``end``; jump to 1 if they are equal."""
    span = end - start
    ramp = ((x - start) / span.where(span > 0, 1)).clamp(0, 1)
    return ramp.where(span > 0, (x >= start).to(x.dtype))


def _fall(x: "Tensor", start: "Tensor", end: "Tensor") -> "Tensor":
    """Fall linearly from 1 at ``start`` to 0 at ``end``; jump to 0 if they are equal."""
    return _rise(-x, -end, -start)


def log_gaussian(x: "Tensor", centre: "Tensor", width: "Tensor") -> "Tensor":
    """Log μ(x) = −(x − c)²/(2σ²)."""
    return -0.5 * ((x - centre) / width).square()


def gaussian(x: "Tensor", centre: "Tensor", width: "Tensor") -> "Tensor":
    """μ(x) = exp(−(x − c)²/(2σ²))."""
    return log_gaussian(x, centre, width).exp()


def triangle(x: "Tensor", a: "Tensor", b: "Tensor", c: "Tensor") -> "Tensor":
    """μ(x): 0 up to a, 1 at b, 0 from c on, linear between; a = b or b = c is a vertical side."""
    return _rise(x, a, b).minimum(_fall(x, b, c))


def trapezoid(x: "Tensor", a: "Tensor", b: "Tensor", c: "Tensor", d: "Tensor") -> "Tensor":
    """μ(x): 0 up to a, 1 from b to c, 0 from d on, linear between."""
    return _rise(x, a, b).minimum(_fall(x, c, d))


def bell(x: "Tensor", centre: "Tensor", width: "Tensor", slope: "Tensor") -> "Tensor":
    """μ(x) = 1/(1 + |(x − c)/width|^(2·slope)), the generalised bell."""
    return (1 + ((x - centre) / width).abs().pow(2 * slope)).reciprocal()


def log_bell(x: "Tensor", centre: "Tensor", width: "Tensor", slope: "Tensor") -> "Tensor":
    """Log μ(x) = −log(1 + u^(2·slope)), u = |(x − c)/width|, without overflow."""
    u = ((x - centre) / width).abs()
    near = u <= 1
    power = (2 * slope) * u.where(~near, 1).log()
    return -(u.where(near, 1).pow(2 * slope).log1p().where(near, power + (-power).exp().log1p()))


def log_sigmoid(x: "Tensor", inflection: "Tensor", slope: "Tensor") -> "Tensor":
    """Log μ(x) = −log(1 + exp(−slope·(x − inflection))), without overflow."""
    z = slope * (x - inflection)
    return z.clamp(max=0) - (-z.abs()).exp().log1p()


def sigmoid(x: "Tensor", inflection: "Tensor", slope: "Tensor") -> "Tensor":
    """μ(x) = 1/(1 + exp(−slope·(x − inflection))), which falls if the slope is negative."""
    return (slope * (x - inflection)).sigmoid()


def log_gaussian_two_sided(
    x: "Tensor", left: "Tensor", left_width: "Tensor", right: "Tensor", right_width: "Tensor"
) -> "Tensor":
    """Log of :func:`gaussian_two_sided`."""
    below = log_gaussian(x.minimum(left), left, left_width)
    return below + log_gaussian(x.maximum(right), right, right_width)


def gaussian_two_sided(
    x: "Tensor", left: "Tensor", left_width: "Tensor", right: "Tensor", right_width: "Tensor"
) -> "Tensor":
    """μ(x): 1 from left to right, and half a Gaussian on either side, each with its own width."""
    return log_gaussian_two_sided(x, left, left_width, right, right_width).exp()


def log_triangle(x: "Tensor", a: "Tensor", b: "Tensor", c: "Tensor") -> "Tensor":
    """Log of :func:`triangle`; −∞ where it is 0."""
    return triangle(x, a, b, c).log()


def log_trapezoid(x: "Tensor", a: "Tensor", b: "Tensor", c: "Tensor", d: "Tensor") -> "Tensor":
    """Log of :func:`trapezoid`; −∞ where it is 0."""
    return trapezoid(x, a, b, c, d).log()


@dataclass(frozen=True)
class MembershipFunction:
    """A kind of membership function.

    Attributes:
        parameters: the parameters' names in our order.
        degree: the formula of μ(x).
        log_degree: the formula of log μ(x), which doesn't underflow far from the label.
        highest: the parameters whose mean is the middle of the highest part.
        positive: the parameters that must be above 0.
        rising: the parameters whose values must not decrease, in this order.
        fll: its name in the FuzzyLite Language, which has the same order of parameters.
        fis: its name in MATLAB's and Octave's .fis files.
        fis_order: for each parameter in a .fis file, its index in our order.
        compact: whether μ is 0 outside the interval from the first to the last parameter.
    """

    parameters: tuple[str, ...]
    degree: Formula
    log_degree: Formula
    highest: tuple[str, ...]
    positive: tuple[str, ...]
    rising: tuple[str, ...]
    fll: str
    fis: str
    fis_order: tuple[int, ...]
    compact: bool = False

    def misfit(self, numbers: Sequence[float]) -> str | None:
        """Return the condition that parameters violate, to complete "must be"; None if they fit."""
        if len(numbers) != len(self.parameters) or not all(map(isfinite, numbers)):
            return f"{len(self.parameters)} finite numbers [{', '.join(self.parameters)}]"
        given = dict(zip(self.parameters, numbers, strict=True))
        for name in self.positive:
            if given[name] <= 0:
                return f"[{', '.join(self.parameters)}] with {name} > 0"
        ordered = [given[name] for name in self.rising]
        flat = self.compact and given[self.parameters[0]] >= given[self.parameters[-1]]
        if ordered != sorted(ordered) or flat:
            strictly = f" and {self.rising[0]} < {self.rising[-1]}" if self.compact else ""
            return f"[{', '.join(self.parameters)}] with {' <= '.join(self.rising)}{strictly}"
        return None

    def support(self, numbers: Sequence[float]) -> tuple[float, float]:
        """Return the ends of the interval where μ > 0, for given parameters."""
        return (numbers[0], numbers[-1]) if self.compact else (-inf, inf)

    def narrowest(self, numbers: Sequence[float]) -> float:
        """Return the smallest width among the given parameters; infinite without a width."""
        named = zip(self.parameters, numbers, strict=True)
        return min((number for name, number in named if name.endswith("width")), default=inf)

    def middle(self, numbers: Sequence[float]) -> float:
        """Return the middle of the part where μ is highest; for a sigmoid, its inflection."""
        tops = [
            number
            for name, number in zip(self.parameters, numbers, strict=True)
            if name in self.highest
        ]
        return sum(tops) / len(tops)


MEMBERSHIP_FUNCTIONS = {
    "gaussian": MembershipFunction(
        ("centre", "width"),
        gaussian,
        log_gaussian,
        highest=("centre",),
        positive=("width",),
        rising=(),
        fll="Gaussian",
        fis="gaussmf",
        fis_order=(1, 0),
    ),
    "triangle": MembershipFunction(
        ("a", "b", "c"),
        triangle,
        log_triangle,
        highest=("b",),
        positive=(),
        rising=("a", "b", "c"),
        fll="Triangle",
        fis="trimf",
        fis_order=(0, 1, 2),
        compact=True,
    ),
    "trapezoid": MembershipFunction(
        ("a", "b", "c", "d"),
        trapezoid,
        log_trapezoid,
        highest=("b", "c"),
        positive=(),
        rising=("a", "b", "c", "d"),
        fll="Trapezoid",
        fis="trapmf",
        fis_order=(0, 1, 2, 3),
        compact=True,
    ),
    "bell": MembershipFunction(
        ("centre", "width", "slope"),
        bell,
        log_bell,
        highest=("centre",),
        positive=("width", "slope"),
        rising=(),
        fll="Bell",
        fis="gbellmf",
        fis_order=(1, 2, 0),
    ),
    "sigmoid": MembershipFunction(
        ("inflection", "slope"),
        sigmoid,
        log_sigmoid,
        highest=("inflection",),
        positive=(),
        rising=(),
        fll="Sigmoid",
        fis="sigmf",
        fis_order=(1, 0),
    ),
    "gaussian_two_sided": MembershipFunction(
        ("left", "left_width", "right", "right_width"),
        gaussian_two_sided,
        log_gaussian_two_sided,
        highest=("left", "right"),
        positive=("left_width", "right_width"),
        rising=("left", "right"),
        fll="GaussianProduct",
        fis="gauss2mf",
        fis_order=(1, 0, 3, 2),
    ),
}
"""The membership functions by name."""


def product(strength: "Tensor", degree: "Tensor") -> "Tensor":
    """The product t-norm."""
    return strength * degree


def minimum(strength: "Tensor", degree: "Tensor") -> "Tensor":
    """The minimum t-norm."""
    return strength.minimum(degree)


@dataclass(frozen=True)
class TNorm:
    """A way to combine the degrees of a rule's labels: commutative, with 1 as its neutral element.

    Attributes:
        combine: the function of two degrees, element by element.
        fll, fis: its name in the FuzzyLite Language and in MATLAB's and Octave's .fis files.
    """

    combine: Formula
    fll: str
    fis: str


T_NORMS = {
    "product": TNorm(product, fll="AlgebraicProduct", fis="prod"),
    "minimum": TNorm(minimum, fll="Minimum", fis="min"),
}
"""The t-norms by name."""

ELSEWHERE = ("nearest", "zero")
"""The choices for a number outside of all labels: the nearest label fires, or the output is 0."""


Membership = tuple[str, tuple[float, ...]]
"""A key of :data:`MEMBERSHIP_FUNCTIONS`, and the function's parameters."""


def rule_width(width: float, reading: str) -> float:
    """Return σ for a label's second number, which is σ (``sigma``) or σ² (``variance``)."""
    return sqrt(width) if reading == "variance" else width


def membership_of(label: Sequence[float] | Mapping[str, Sequence[float]], width: str) -> Membership:
    """Return the membership function of a label in a configuration.

    Args:
        label: ``[centre, width]`` for a Gaussian, or ``{kind: [parameters]}``.
        width: whether the second number of ``[centre, width]`` is a ``sigma`` or a ``variance``.
    """
    if isinstance(label, Mapping):
        ((kind, parameters),) = label.items()
        return kind, tuple(map(float, parameters))
    centre, second = label
    return "gaussian", (float(centre), rule_width(float(second), width))


def even_labels(low: float, high: float, count: int) -> list[Membership]:
    """Return Gaussian labels evenly spaced from one end of a range to the other.

    Halfway between two neighbours, both have membership ½: σ = d/√(8 ln 2) for a distance d.

    Args:
        low, high: the range's ends, finite.
        count: the number of labels; a single label lies in the middle.
    """
    if count == 1:
        return [("gaussian", ((low + high) / 2, (high - low) / 2))]
    apart = (high - low) / (count - 1)
    return [("gaussian", (low + i * apart, apart / sqrt(8 * log(2)))) for i in range(count)]
