"""A compiler from a step to C++ for CPUs: one run's computation, on vectors of lanes.

A lane is the place of one run in a batch. The stages:

1. :mod:`fnnq_torchrl.engine.graphs` traces the step for two runs into a graph of torch operations.
2. :mod:`.executor` interprets the graph on arrays of symbolic scalar expressions (:mod:`.arrays`,
   :mod:`.expressions`). This removes views and broadcasts, and merges equal expressions. A small
   dimension has an expression for each element. A large one has a single expression for all its
   elements, a family, which depends on a loop variable.
3. :mod:`.translation` compares the two runs: each must compute the same function of its own state
   alone.
4. :mod:`.nests` orders one run's expressions and puts families in loops, and what only some lanes
   need in branches. A sum shares the loop of the products that it adds up. :mod:`.idle` finds the
   loops of which most rows stay as they are.
5. :mod:`.statements` writes them as text, in the words of a language: :mod:`.source` has those of
   C++, and writes the program; :mod:`.build` compiles and caches it.

If the program of a step is in the cache, :mod:`.known` finds it without these stages.
"""

from .build import CannotCompile, cache_directory, check_compiler
from .errors import RunsMixed, Unsupported
from .loop import NativeLoop

__all__ = [
    "CannotCompile",
    "NativeLoop",
    "RunsMixed",
    "Unsupported",
    "cache_directory",
    "check_compiler",
]
