"""The pictures of a job and of a sweep, drawn from their result files."""

import os
import sys
from contextlib import suppress

# A notebook's MPLBACKEND or a matplotlibrc in another encoding can make the import of Matplotlib
# fail. Our pictures need neither, so the import is tried again without them. If it fails again, the
# modules that draw raise the error when they are imported.
try:
    import matplotlib
except Exception:
    for name in [name for name in sys.modules if name.startswith("matplotlib.")]:
        del sys.modules[name]  # left by the failed import
    os.environ |= {"MPLBACKEND": "agg", "MATPLOTLIBRC": os.devnull}
    with suppress(Exception):
        import matplotlib  # noqa: F401
