"""Pictures, drawn from result files alone. The only package that imports matplotlib."""

from .curves import (
    Curve,
    curves_figure,
    learning_curve,
    learning_curve_figure,
    sweep_curves,
)
from .style import spread

__all__ = [
    "Curve",
    "curves_figure",
    "learning_curve",
    "learning_curve_figure",
    "spread",
    "sweep_curves",
]
