"""The fuzzy rule base in plain Python, one rule after the other, as the paper writes it."""

from collections.abc import Sequence
from itertools import product
from math import exp, prod

Label = tuple[float, float]  # centre, width σ


def membership(x: float, label: Label) -> float:
    """Return μ(x) of a Gaussian label."""
    centre, width = label
    return exp(-((x - centre) ** 2) / (2 * width**2))


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
