"""How much memory a batch of runs will take, and how much there is: told before anything computes.

Pure arithmetic on a configuration. `benchmarks/memory.py` compares it with what jobs really take.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path

from fnnq_torchrl.config import Config, ConfigError

_NUMBER = 8
"""Bytes of an int64, a float64 or a reference to a Python object."""

_OF_PYTHON = 6 * _NUMBER
"""Bytes of a small Python object that stands in a list, with its reference."""

_BASE = 600 * 2**20
"""Bytes of the process before it has any run: torch, TorchRL, the traced step."""

_COLUMNS = 40
"""Columns of numbers of each run: its values, as lists and as tensors, of the jobs and the batch."""

_COPIES = 4
"""Of what an eager step, the most wasteful, computes for each candidate action."""


@dataclass(frozen=True)
class Sizes:
    """What a batch is made of.

    Attributes:
        runs: in the batch.
        evaluations: of each run, the one before learning included.
        tests: situations in each.
        weights: of a run.
        candidates: actions among which a run seeks the best.
        window: steps that a run's trace keeps, 1 if it isn't a window.
        lanes: runs that learn at once, of all workers together.
        bytes: of a weight.
    """

    runs: int
    evaluations: int
    tests: int
    weights: int
    candidates: int
    window: int
    lanes: int
    bytes: int

    @property
    def kept(self) -> int:
        """Bytes for what is kept of all evaluations: weights, steps, catches, situations played."""
        of_evaluation = self.weights * self.bytes + 2 * _NUMBER + self.tests
        return self.runs * (self.evaluations * of_evaluation + _COLUMNS * _NUMBER)

    @property
    def at_work(self) -> int:
        """Bytes for the runs that learn at once: state, trace, and what a step computes."""
        of_step = self.weights * (4 + self.window) + self.candidates * _COPIES
        return self.lanes * self.bytes * of_step + self.candidates * self.weights * self.bytes

    @property
    def on_top(self) -> int:
        """Bytes at the end: the list of all situations to play or, later, the rows to write."""
        playing = self.tests * 2 * _NUMBER
        writing = 2 * _OF_PYTHON + 2 * _NUMBER
        saving = self.weights * self.bytes
        return self.runs * self.evaluations * max(playing, writing, saving)

    @property
    def total(self) -> int:
        """Bytes at the peak."""
        return _BASE + self.kept + max(self.at_work, self.on_top)


def available() -> float:
    """Bytes that this process can still get, as far as the system says: or else infinitely many."""
    return min((free for free in (_free_memory(), *_free_of_groups()) if free is not None), default=inf)
