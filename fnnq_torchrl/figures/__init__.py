"""Pictures, drawn from result files alone. The only package that imports matplotlib."""

from .curves import learning_curve, learning_curve_figure
from .style import spread

__all__ = ["learning_curve", "learning_curve_figure", "spread"]
