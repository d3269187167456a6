"""Membership functions and t-norms: formulas, parameters, and their names in other programs' files.

A registry with one entry a function. All arithmetic is by methods of the tensors, element by
element, in whatever dtype they have, so that nothing here imports torch: a configuration can be
checked against the registry before anything heavy is loaded.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, log, sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

Formula = Callable[..., "Tensor"]
"""``formula(x, *parameters)``: tensors that broadcast with each other, to one of their shape."""


def _rise(x: "Tensor", start: "Tensor", end: "Tensor") -> "Tensor":
    """From 0 at ``start`` to 1 at ``end``; a jump to 1 where they are the same."""
    span = end - start
    ramp = ((x - start) / span.where(span > 0, 1)).clamp(0, 1)
    return ramp.where(span > 0, (x >= start).to(x.dtype))


def _fall(x: "Tensor", start: "Tensor", end: "Tensor") -> "Tensor":
    """From 1 at ``start`` to 0 at ``end``; a jump to 0 where they are the same."""
    return _rise(-x, -end, -start)


def log_gaussian(x: "Tensor", centre: "Tensor", width: "Tensor") -> "Tensor":
    """Log μ(x) = −(x − c)²/(2σ²)."""
    return -0.5 * ((x - centre) / width).square()


def gaussian(x: "Tensor", centre: "Tensor", width: "Tensor") -> "Tensor":
    """μ(x) = exp(−(x − c)²/(2σ²))."""
    return log_gaussian(x, centre, width).exp()


def triangle(x: "Tensor", a: "Tensor", b: "Tensor", c: "Tensor") -> "Tensor":
    """0 up to a, 1 at b, 0 from c on, straight between; a = b or b = c makes a vertical side."""
    return _rise(x, a, b).minimum(_fall(x, b, c))


def trapezoid(x: "Tensor", a: "Tensor", b: "Tensor", c: "Tensor", d: "Tensor") -> "Tensor":
    """0 up to a, 1 from b to c, 0 from d on, straight between."""
    return _rise(x, a, b).minimum(_fall(x, c, d))


def bell(x: "Tensor", centre: "Tensor", width: "Tensor", slope: "Tensor") -> "Tensor":
    """μ(x) = 1/(1 + |(x − c)/width|^(2·slope)), the generalised bell."""
    return (1 + ((x - centre) / width).abs().pow(2 * slope)).reciprocal()


def log_bell(x: "Tensor", centre: "Tensor", width: "Tensor", slope: "Tensor") -> "Tensor":
    """Log μ(x) = −log(1 + u^(2·slope)), u = |(x − c)/width|; by its asymptote where u is large."""
    u = ((x - centre) / width).abs()
    near = u <= 1
    power = (2 * slope) * u.where(~near, 1).log()
    return -(u.where(near, 1).pow(2 * slope).log1p().where(near, power + (-power).exp().log1p()))


def log_sigmoid(x: "Tensor", inflection: "Tensor", slope: "Tensor") -> "Tensor":
    """Log μ(x) = −log(1 + exp(−slope·(x − inflection))), without overflow."""
    z = slope * (x - inflection)
    return z.clamp(max=0) - (-z.abs()).exp().log1p()


def sigmoid(x: "Tensor", inflection: "Tensor", slope: "Tensor") -> "Tensor":
    """μ(x) = 1/(1 + exp(−slope·(x − inflection))); it falls where the slope is negative."""
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
    """1 from left to right, and half a Gaussian on either side, each with its own width."""
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
        parameters: their names, in our order.
        degree: μ(x), the formula.
        log_degree: log μ(x), which doesn't underflow far from the label.
        highest: the parameters between which it is highest.
        positive: the parameters that must be above 0.
        rising: the parameters that must not fall, in this order.
        fll: its name in FuzzyLite's language, whose terms have their parameters in our order.
        fis: its name in MATLAB's and Octave's systems.
        fis_order: for each of their parameters, the place of ours.
        compact: whether it is 0 outside its first and last parameter.
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
        """What is wrong with parameters, in words that complete "must be"; None if they fit."""
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
        """Between which numbers it is above 0, of given parameters."""
        return (numbers[0], numbers[-1]) if self.compact else (-inf, inf)

    def middle(self, numbers: Sequence[float]) -> float:
        """The middle of where it is highest, of given parameters; of a sigmoid, its inflection."""
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
"""The membership functions by their names."""


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
        combine: of two degrees, element by element.
        fll, fis: its name in FuzzyLite's language, and in MATLAB's and Octave's systems.
    """

    combine: Formula
    fll: str
    fis: str


T_NORMS = {
    "product": TNorm(product, fll="AlgebraicProduct", fis="prod"),
    "minimum": TNorm(minimum, fll="Minimum", fis="min"),
}
"""The t-norms by their names."""

ELSEWHERE = ("nearest", "zero")
"""What fires where no label does: the nearest one, or none, which makes the output 0."""


Membership = tuple[str, tuple[float, ...]]
"""A kind, of :data:`MEMBERSHIP_FUNCTIONS`, and its parameters."""


def rule_width(width: float, reading: str) -> float:
    """σ from the paper's second number, read as the ``sigma`` itself or as a ``variance`` σ²."""
    return sqrt(width) if reading == "variance" else width


def membership_of(label: Sequence[float] | Mapping[str, Sequence[float]], width: str) -> Membership:
    """The membership function of a label as a configuration has it.

    Args:
        label: ``[centre, width]`` of a Gaussian, or ``{kind: [parameters]}``.
        width: whether the second number of ``[centre, width]`` is a ``sigma`` or a ``variance``.
    """
    if isinstance(label, Mapping):
        ((kind, parameters),) = label.items()
        return kind, tuple(map(float, parameters))
    centre, second = label
    return "gaussian", (float(centre), rule_width(float(second), width))


def even_labels(low: float, high: float, count: int) -> list[Membership]:
    """Gaussians, evenly spaced from end to end.

    Neighbours have the same membership, ½, halfway between them: σ = d/√(8 ln 2) at a distance d.

    Args:
        low, high: the range, finite.
        count: how many there are; a single one lies in the middle.
    """
    if count == 1:
        return [("gaussian", ((low + high) / 2, (high - low) / 2))]
    apart = (high - low) / (count - 1)
    return [("gaussian", (low + i * apart, apart / sqrt(8 * log(2)))) for i in range(count)]
