"""Imports of large libraries without the garbage collector."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Exclude the modules that the block imports from garbage collection, for the whole process.

    Modules stay until the process ends, so their objects are never garbage. The collector would
    scan the objects of torch and TorchRL repeatedly during the import, and again when the process
    ends. These scans take a quarter of the time of the import.
    """
    modules, was_enabled = len(sys.modules), gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if len(sys.modules) > modules:
            gc.freeze()
        if was_enabled:
            gc.enable()
