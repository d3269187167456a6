"""The pictures of a job and of a sweep, drawn from their result files."""

import os
import sys
from contextlib import suppress

# A notebook's MPLBACKEND or a matplotlibrc in another encoding can stop the import of Matplotlib.
# Our pictures need neither, so the second try is without them. If that fails too, the first module
# here that draws raises the error.
try:
    import matplotlib
except Exception:
    for name in [name for name in sys.modules if name.startswith("matplotlib.")]:
        del sys.modules[name]  # the failed import has left it
    os.environ |= {"MPLBACKEND": "agg", "MATPLOTLIBRC": os.devnull}
    with suppress(Exception):
        import matplotlib  # noqa: F401
