"""Compiles a step for CPUs: one run's scalars, written out in C++ on vectors of lanes."""

from .build import cache_directory, compiler, compiler_found
from .expressions import Unsupported
from .loop import NativeLoop, RunsMixed

__all__ = [
    "NativeLoop",
    "RunsMixed",
    "Unsupported",
    "cache_directory",
    "compiler",
    "compiler_found",
]
