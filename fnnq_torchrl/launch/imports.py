"""Imports of large libraries without the garbage collector."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Keep the garbage collector away from modules that the block imports, now and later.

    Modules stay until the process ends, so their objects are no garbage. Looking through those of
    torch and TorchRL, again and again during their import and once more at the process's end, takes
    a quarter of the time that importing them takes.
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
