"""The pictures of a job and of a sweep, drawn from their result files."""

from fnnq_torchrl.training.pictures.curves import (
    Curve,
    curves_figure,
    learning_curve,
    learning_curve_figure,
    sweep_curves,
)
from fnnq_torchrl.training.pictures.style import spread

__all__ = [
    "Curve",
    "curves_figure",
    "learning_curve",
    "learning_curve_figure",
    "spread",
    "sweep_curves",
]
