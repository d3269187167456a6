"""The fuzzy rule base in plain Python, one rule after the other, as the paper writes it."""

from collections.abc import Sequence
from itertools import product
from math import exp, inf, prod

Label = Sequence[float] | dict[str, Sequence[float]]  # centre and width σ, or {kind: parameters}


def membership(x: float, label: Label) -> float:
    """Return μ(x)."""
    if not isinstance(label, dict):
        return gaussian(x, *label)
    ((kind, parameters),) = label.items()
    return KINDS[kind](x, *parameters)


def gaussian(x: float, centre: float, width: float) -> float:
    return exp(-((x - centre) ** 2) / (2 * width**2))


def trapezoid(x: float, a: float, b: float, c: float, d: float) -> float:
    if b <= x <= c:
        return 1.0
    if x <= a or x >= d:
        return 0.0
    return (x - a) / (b - a) if x < b else (d - x) / (d - c)


def gaussian_two_sided(x: float, left: float, below: float, right: float, above: float) -> float:
    if x < left:
        return gaussian(x, left, below)
    return gaussian(x, right, above) if x > right else 1.0


KINDS = {
    "gaussian": gaussian,
    "triangle": lambda x, a, b, c: trapezoid(x, a, b, b, c),
    "trapezoid": trapezoid,
    "bell": lambda x, centre, width, slope: 1 / (1 + abs((x - centre) / width) ** (2 * slope)),
    "sigmoid": lambda x, middle, slope: 1 / (1 + exp(-slope * (x - middle))),
    "gaussian_two_sided": gaussian_two_sided,
}


def degrees(x: float, labels: Sequence[Label], elsewhere: str) -> list[float]:
    """Return μ(x) of every label.

    If all are 0, the nearest label has 1, unless ``elsewhere`` is ``zero``.
    """
    found = [membership(x, label) for label in labels]
    if any(found) or elsewhere == "zero":
        return found

    def distance(label: Label) -> float:
        ((kind, numbers),) = label.items() if isinstance(label, dict) else [("gaussian", label)]
        if kind not in ("triangle", "trapezoid"):
            return inf
        return max(numbers[0] - x, x - numbers[-1])

    nearest = min(range(len(labels)), key=lambda i: distance(labels[i]))
    return [float(i == nearest) for i in range(len(labels))]


def value_of_rules(
    consequents: Sequence[float],
    x: Sequence[float],
    labels: Sequence[Sequence[Label]],
    t_norm: str = "product",
    elsewhere: str = "nearest",
) -> float:
    """Return Σwσ/Σσ over all rules, or 0 if Σσ = 0; σ is the product or minimum of memberships."""
    combine = {"product": prod, "minimum": min}[t_norm]
    of_inputs = [degrees(*pair, elsewhere) for pair in zip(x, labels, strict=True)]
    strengths = [*map(combine, product(*of_inputs))]
    if not sum(strengths):
        return 0.0
    return sum(w * s for w, s in zip(consequents, strengths, strict=True)) / sum(strengths)


def normalised_firing_strengths(x: Sequence[float], labels: Sequence[list[Label]]) -> list[float]:
    """Return σᵢ/Σσ of every rule (eq. 7); a rule has one label of each input.

    Args:
        x: the inputs; the last is the action.
        labels: the labels of each input; the last input's label changes fastest over the rules.
    """
    strengths = [prod(map(membership, x, rule)) for rule in product(*labels)]
    return [strength / sum(strengths) for strength in strengths]


def action_value(
    consequents: Sequence[float], x: Sequence[float], labels: Sequence[list[Label]]
) -> float:
    """Return Q(s, a), the centre of area of the rules' consequents (eq. 8)."""
    return sum(
        w * f for w, f in zip(consequents, normalised_firing_strengths(x, labels), strict=True)
    )
