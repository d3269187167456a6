"""Compiles a step for CPUs: what one run computes, written out in C++ on vectors of lanes.

The way from a step to a program:

1. :mod:`fnnq_torchrl.engine.graphs` traces the step for two runs: one graph of torch's operations.
2. :mod:`.executor` carries that graph out on arrays of scalar expressions
   (:mod:`.arrays`, :mod:`.expressions`). Views and broadcasts are gone then, and what is computed
   twice is found. Small dimensions are written out, an expression for each number. Of large ones
   there is one expression for all numbers, a family, which depends on a loop's variable.
3. :mod:`.loop` compares the two runs: each must do the same with its own numbers alone.
4. :mod:`.nests` puts what one run computes in an order, families in loops. Sums share the loop of
   the products that they add up.
5. :mod:`.source` writes the program, :mod:`.build` compiles it and keeps it.
"""

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
