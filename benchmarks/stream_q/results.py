"""The returns of both programs' runs over the learning steps."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.results import Evaluations

PARTS = 20
"""The number of equal parts of the learning steps, each with its mean return."""

MEASURED = Path(__file__).with_name("theirs.csv")
"""The returns of the authors' program, measured so far."""


@dataclass(frozen=True)
class Measured:
    """A run of the authors' program.

    Attributes:
        task: the name of the task.
        steps: the number of learning steps.
        seed: the seed.
        date: the day of the run, as in 2026-11-26.
        returns: the mean return in each part of the steps.
    """

    task: str
    steps: int
    seed: int
    date: str
    returns: tuple[float, ...]


def in_parts(ends: ArrayLike, returns: ArrayLike, steps: int) -> NDArray[np.float64]:
    """Return the mean over the steps of each part of the return of the episodes going on.

    Args:
        ends: the steps after which episodes, or groups of them, have ended, rising.
        returns: the mean return of each. Later steps have the return of the last.
        steps: the number of learning steps.

    Returns:
        ``[PARTS]``.
    """
    given = np.asarray(returns, dtype=np.float64)
    of_step = np.searchsorted(np.asarray(ends), np.arange(steps), side="right")
    means: NDArray[np.float64] = (
        given[of_step.clip(max=given.size - 1)].reshape(PARTS, -1).mean(axis=1)
    )
    return means


def ours_in_parts(evaluations: Evaluations, steps: int) -> NDArray[np.float64]:
    """Return the returns of our runs in each part, ``[runs, PARTS]``."""
    rows = zip(evaluations.steps[:, 1:], evaluations.returns[:, 1:], strict=True)
    return np.stack([in_parts(ends, returns, steps) for ends, returns in rows])


def grouped(ends: Sequence[int], returns: Sequence[float], size: int) -> tuple[list[int], ...]:
    """Return the ends and mean returns of groups of episodes, as our result files have them."""
    groups = range(0, len(ends), size)
    means = [float(np.mean(returns[begin : begin + size])) for begin in groups]
    return [ends[min(begin + size, len(ends)) - 1] for begin in groups], means


def read_measured(path: Path = MEASURED) -> list[Measured]:
    """Read the runs of the authors' program, none if there is no file."""
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        return [
            Measured(task, int(steps), int(seed), date, tuple(map(float, returns)))
            for task, steps, seed, date, *returns in csv.reader(file)
        ]


def write_measured(runs: Sequence[Measured], path: Path = MEASURED) -> None:
    """Write the runs of the authors' program, a line each, sorted."""
    lines = [
        ",".join([run.task, str(run.steps), str(run.seed), run.date, *map(str, run.returns)])
        for run in sorted(runs, key=lambda run: (run.task, run.steps, run.seed))
    ]
    with atomic_write(path) as file:
        file.write("".join(f"{line}\n" for line in lines).encode())
