"""The errors of predicted values in the random walk."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.training.weights import load_snapshots


class Errors(NamedTuple):
    """The errors of the predicted values with one trace, λ and α.

    Attributes:
        trace, lam, alpha: the kind of trace, λ and α.
        errors: the root mean square error of the states' values, mean over episodes, ``[runs]``.
        before: the error before learning, equal in all runs.
    """

    trace: str
    lam: float
    alpha: float
    errors: NDArray[np.float64]
    before: float


def true_values(states: int, left: float, right: float) -> NDArray[np.float64]:
    """Return the expected return of each state, ``[states]``.

    From state k of n, the walk ends on the right with probability k/(n + 1).
    """
    share = np.arange(1, states + 1) / (states + 1)
    values: NDArray[np.float64] = left + (right - left) * share
    return values


def root_mean_square(
    values: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return √ of the mean over the states of (v − truth)², from ``[…, states]`` to ``[…]``."""
    error: NDArray[np.float64] = np.sqrt(np.square(values - truth).mean(axis=-1))
    return error


def read_errors(experiment: Experiment) -> list[Errors]:
    """Return the errors of every job, from the weights of the table after each episode.

    Raises:
        OSError, ValueError: if a file of snapshots can't be read.
    """
    return [_of_job(job) for job in experiment.jobs]


def _of_job(job: Job) -> Errors:
    world = job.config.env
    weights = load_snapshots(job.directory / "snapshots.pt").weights["weight"]
    values = weights.squeeze(-1).numpy().astype(np.float64)  # [evaluations, runs, states]
    truth = true_values(world.states, world.left_reward, world.right_reward)
    errors = root_mean_square(values, truth)
    config = job.config
    return Errors(
        config.trace, config.lam, config.alpha, errors[1:].mean(axis=0), float(errors[0, 0])
    )
