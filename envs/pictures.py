"""Matplotlib without the user's settings. All drawing modules import Matplotlib from here.

Pictures are drawn through `Figure` and `FigureCanvasAgg`, so no command needs a display.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path

# A notebook's MPLBACKEND or a matplotlibrc in another encoding can make the import of Matplotlib
# fail. Our pictures need neither, so a failed import is tried again without them. The second import
# runs in a directory without a matplotlibrc, because such a file would override the variable.
try:
    import matplotlib
except Exception:
    for name in [name for name in sys.modules if name.startswith("matplotlib.")]:
        del sys.modules[name]  # left by the failed import
    os.environ |= {"MPLBACKEND": "agg", "MATPLOTLIBRC": os.devnull}
    with chdir(Path(__file__).parent):
        import matplotlib  # noqa: F401

from matplotlib import rc_context, rcdefaults
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle, Wedge
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from matplotlib.transforms import Transform

__all__ = [
    "Axes",
    "Circle",
    "Figure",
    "FigureCanvasAgg",
    "LineCollection",
    "MaxNLocator",
    "Patch",
    "Polygon",
    "Rectangle",
    "ScalarFormatter",
    "Transform",
    "Wedge",
    "own_style",
    "rc_context",
]


@contextmanager
def own_style() -> Iterator[None]:
    """Use Matplotlib's defaults, not the user's settings, in a block or a decorated function."""
    with rc_context():
        rcdefaults()
        yield
