"""The off-line λ-return algorithm, on the walks from which the runs of a job learned."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from envs.classic.schemas import RandomWalkConfig
from envs.worlds import make_world
from fnnq_torchrl.studies.experiments import Experiment

from .walk import Errors, root_mean_square, true_values

NAME = "off-line λ-return"
"""The name of the algorithm, in the place of a trace's."""


@dataclass(frozen=True)
class Walk:
    """An episode of each run. A walk that is shorter than the longest is filled up with 0.

    Attributes:
        places: the states from 1, in their order, int64 ``[longest, runs]``.
        rewards: the reward of each run's end, ``[runs]``.
    """

    places: NDArray[np.int64]
    rewards: NDArray[np.float64]

    @property
    def walking(self) -> NDArray[np.bool_]:
        """True where a run was still walking, bool ``[longest, runs]``."""
        return self.places > 0


def walks(world: RandomWalkConfig, seeds: NDArray[np.int64], episodes: int) -> list[Walk]:
    """Return the first walks of the runs with these seeds.

    They are the ones in which a job's runs with these seeds learn, since chance alone moves the
    walker.
    """
    env = make_world(world, [len(seeds)], seed=0)
    found = []
    seed = torch.from_numpy(seeds.copy()).unsqueeze(-1)
    for episode in range(episodes):
        state = env.start(seed, torch.full_like(seed, episode))
        walking = torch.ones(len(seeds), dtype=torch.bool)
        places, rewards = [], torch.zeros(len(seeds))
        while walking.any():
            places.append(torch.where(walking, state["place"].squeeze(-1), 0))
            after = env.step(state.set("action", torch.zeros_like(state["place"])))["next"]
            ends = walking & after["done"].squeeze(-1)
            rewards = torch.where(ends, after["reward"].squeeze(-1), rewards)
            walking = walking & ~ends
            state = after
        found.append(Walk(torch.stack(places).long().numpy(), rewards.double().numpy()))
    return found


def learned(
    values: NDArray[np.float64], walk: Walk, lam: float, alpha: float
) -> NDArray[np.float64]:
    """Return the values of each run after an episode.

        Gₜ = (1 − λ)V(sₜ₊₁) + λGₜ₊₁,  or the reward in the last step
        V(sₜ) ← V(sₜ) + α(Gₜ − V(sₜ))

    The λ-returns G are computed with the values before the episode. The updates then follow in the
    order of the steps. γ = 1.

    Source: R. S. Sutton, A. G. Barto, "Reinforcement learning", 2018, section 12.1.

    Args:
        values: the values before the episode, ``[runs, states]``.
        walk: the episode.
        lam, alpha: λ and α.
    """
    places, walking = np.maximum(walk.places - 1, 0), walk.walking
    run = np.arange(len(values))
    targets = np.empty(places.shape)
    ahead = np.zeros(len(values))
    for t in reversed(range(len(places))):
        last = walking[t] & ~(walking[t + 1] if t + 1 < len(places) else False)
        following = values[run, places[t + 1]] if t + 1 < len(places) else 0.0
        ahead = np.where(last, walk.rewards, (1 - lam) * following + lam * ahead)
        targets[t] = ahead
    after = values.copy()
    for place, target, still in zip(places, targets, walking, strict=True):
        here = after[run, place]
        after[run, place] = here + alpha * still * (target - here)
    return after


def return_errors(experiment: Experiment) -> list[Errors]:
    """Return the errors of the algorithm with every λ and α of an experiment's jobs.

    Args:
        experiment: the results of ``+experiment=sutton_barto_12_6``.
    """
    job = experiment.jobs[0]
    world, episodes = job.config.env, job.config.situations
    taken = walks(world, job.evaluations.seed, episodes)
    pairs = sorted({(each.config.lam, each.config.alpha) for each in experiment.jobs})
    return [_errors(world, taken, lam, alpha) for lam, alpha in pairs]


def _errors(world: RandomWalkConfig, taken: Sequence[Walk], lam: float, alpha: float) -> Errors:
    truth = true_values(world.states, world.left_reward, world.right_reward)
    values = np.zeros((taken[0].rewards.size, world.states))
    before, errors = float(root_mean_square(values[0], truth)), []
    for walk in taken:
        values = learned(values, walk, lam, alpha)
        errors.append(root_mean_square(values, truth))
    return Errors(NAME, lam, alpha, np.mean(errors, axis=0), before)
