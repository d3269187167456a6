"""The shares of stable solutions on the ring, beside those of the published replication."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from fnnq_torchrl.equations.reward_means import LOST
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.studies.statistics import Interval
from fnnq_torchrl.training.results import CONFIDENCE
from fnnq_torchrl.training.solved import SOLVED, read_solved

RUNS = 300
"""The number of runs of the replication."""

STEADY = 0.9
"""The share of later steps that a stable solution stays above the threshold of a solved task."""


class Cell(NamedTuple):
    """A cell of the published table.

    Attributes:
        beta: the form of the inverse temperature.
        states: the number of states.
        start: the first inverse temperature and the first γ.
        stage: 0, or 1 after the switch.
        switches: whether r₂ switches.
    """

    beta: str
    states: int
    start: tuple[float, float]
    stage: int = 0
    switches: bool = False


_EXPLORING, _GREEDY, _SWITCHING = (1.0, 0.99), (10.0, 0.5), (1.0, 0.5)

PUBLISHED = {
    Cell("exponential", 4, _EXPLORING): 0.837,
    Cell("affine", 4, _EXPLORING): 0.867,
    Cell("exponential", 8, _EXPLORING): 0.483,
    Cell("affine", 8, _EXPLORING): 0.480,
    Cell("exponential", 10, _EXPLORING): 0.157,
    Cell("affine", 10, _EXPLORING): 0.177,
    Cell("exponential", 4, _GREEDY): 0.660,
    Cell("affine", 4, _GREEDY): 0.003,
    Cell("exponential", 8, _GREEDY): 0.003,
    Cell("affine", 8, _GREEDY): 0.0,
    Cell("exponential", 10, _GREEDY): 0.0,
    Cell("affine", 10, _GREEDY): 0.0,
    Cell("exponential", 8, _SWITCHING, 0, True): 0.353,
    Cell("affine", 8, _SWITCHING, 0, True): 0.627,
    Cell("exponential", 8, _SWITCHING, 1, True): 0.153,
    Cell("affine", 8, _SWITCHING, 1, True): 0.077,
}
"""The replication's shares of stable solutions, each of 300 runs."""


@dataclass(frozen=True, eq=False)
class Shares:
    """The outcomes of a cell's runs, each bool ``[runs]``.

    The replication's program calls a solution unstable if the mean reward falls below 75 % of the
    best *and* is above 95 % for less than 90 % of the later steps. Its text says *or*.

    Attributes:
        solved: whether the task was solved.
        stable: whether the solution was stable, by the program.
        stable_by_text: whether it was, by the text.
    """

    solved: NDArray[np.bool_]
    stable: NDArray[np.bool_]
    stable_by_text: NDArray[np.bool_]

    @classmethod
    def of(cls, columns: dict[str, NDArray[np.float64]], stage: int) -> Self:
        """Return the outcomes of a stage, from the columns of ``solved.csv``."""
        solved, lowest, later, above = (
            columns[key][:, stage] for key in ("solved", "lowest", "later", "above")
        )
        dips, unsteady = lowest < LOST, above < STEADY * later
        found = solved > 0
        return cls(found, found & ~(dips & unsteady), found & ~(dips | unsteady))


def read_shares(experiment: Experiment) -> dict[Cell, Shares]:
    """Return the outcomes of each published cell that the experiment has.

    Raises:
        OSError: if a job's ``solved.csv`` can't be read.
        ValueError: if it is damaged.
    """
    shares: dict[Cell, Shares] = {}
    for job in experiment.jobs:
        columns = read_solved(job.directory / SOLVED)
        for stage in range(columns["solved"].shape[1]):
            shares[_cell(job, stage)] = Shares.of(columns, stage)
    return {cell: shares[cell] for cell in PUBLISHED if cell in shares}


def _cell(job: Job, stage: int) -> Cell:
    settings = job.settings
    return Cell(
        settings["adaptive_beta"],
        settings["env.states"],
        (round(1 / settings["temperature"], 6), settings["gamma"]),
        stage,
        settings["env.switch_after_steps"] > 0,
    )


def share(outcomes: NDArray[np.bool_]) -> Interval:
    """Return the share of true outcomes with its interval (Wilson)."""
    count, runs = int(outcomes.sum()), outcomes.size
    low, high = binomtest(count, runs).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(count / runs, low, high)


def agrees(cell: Cell, shares: Shares) -> bool:
    """Return whether our share is the published one, within twice the difference's standard error.

    The error is that of two samples with the mean of both shares, 300 runs and ours.
    """
    ours, theirs, runs = float(shares.stable.mean()), PUBLISHED[cell], shares.stable.size
    both = (ours * runs + theirs * RUNS) / (runs + RUNS)
    error = np.sqrt(both * (1 - both) * (1 / runs + 1 / RUNS))
    return bool(abs(ours - theirs) <= 2 * error)
