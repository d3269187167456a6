"""The steps to learn the way along a chain, and the exact values of its states and actions."""

import numpy as np
import torch
from numpy.typing import NDArray

from envs.classic.chain import right_action
from envs.classic.schemas import ChainConfig
from fnnq_torchrl.studies.experiments import Job
from fnnq_torchrl.training.weights import load_checkpoint


def steps_to_learn(job: Job) -> NDArray[np.float64]:
    """Return the steps of each run up to its last situation with a wrong action, ``[runs]``.

    All situations after it take the shortest way. A run whose last situation still has a wrong
    action has not learned the way; its number is that of all its steps, a lower bound.
    """
    evaluations = job.evaluations
    wrong = evaluations.lengths[:, 1:] != job.config.env.length
    last = wrong.shape[1] - 1 - wrong[:, ::-1].argmax(axis=1)
    steps = np.take_along_axis(evaluations.steps[:, 1:], last[:, None], axis=1)[:, 0]
    # A chain of two states may be walked without an error from the first situation on.
    return np.where(wrong.any(axis=1), steps, job.config.env.length).astype(np.float64)


def not_learned(job: Job) -> int:
    """Return the number of runs whose last situation still has a wrong action."""
    return int((job.evaluations.lengths[:, -1] != job.config.env.length).sum())


def exact_values(world: ChainConfig, gamma: float) -> NDArray[np.float64]:
    """Return Q*(s, a) of a chain, ``[states, actions]``.

    The right action in state k of n has γⁿ⁻ᵏ times the reward of the end; a wrong action that sets
    back to state j has γ times the value of j.
    """
    places = np.arange(1, world.length + 1)
    of_state = world.goal_reward * gamma ** (world.length - places).astype(np.float64)
    back = np.ones_like(places) if world.setback is None else np.maximum(places - world.setback, 1)
    right = right_action(torch.from_numpy(places).double(), world.choices).long().numpy()
    values = np.repeat(gamma * of_state[back - 1, None], world.choices, axis=1)
    values[places - 1, right] = of_state
    return values


def value_error(job: Job) -> NDArray[np.float64]:
    """Return the root mean square of Q − Q* over the table of each run at its end, ``[runs]``.

    Raises:
        OSError, ValueError: if the job's checkpoint can't be read.
    """
    learned = load_checkpoint(job.directory / "checkpoint.pt").weights["weight"].double().numpy()
    exact = exact_values(job.config.env, job.config.gamma)
    error: NDArray[np.float64] = np.sqrt(np.square(learned - exact).mean(axis=(1, 2)))
    return error
