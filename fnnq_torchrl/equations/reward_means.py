"""Running means of the reward, and what they say about a solution. The runs are the last dimension.

Source: N. Schweighofer, K. Doya, "Meta-learning in reinforcement learning", Neural Networks 16,
2003, as M. Sarazin, M. Khamassi, I. Rano and B. Girard replicate it (draft for ReScience, 2018).
"""

from typing import NamedTuple

import torch
from torch import Tensor

SOLVED, LOST = 0.95, 0.75
"""The shares of the best mean reward above which a task is solved, and below which it is lost."""

SETTLING_STEPS = 1_000
"""The steps of a stage before its mean reward counts."""

MEAN_STEPS = 100.0
"""The time constant of both means by which a solution is judged, in steps."""


class Means(NamedTuple):
    """A short and a long running mean of the reward, each ``[runs]``.

    Attributes:
        short: r̄.
        long: r̿.
    """

    short: Tensor
    long: Tensor


def running_means(
    means: Means, reward: Tensor, short_time: Tensor | float, long_time: Tensor | float
) -> Means:
    """Return both means after one more reward.

        r̄ ← r̄ + (r − r̄)/τ₁,   r̿ ← r̿ + (r̄ − r̿)/τ₂ with the new r̄

    Args:
        means: r̄ and r̿ before.
        reward: r, ``[runs]``.
        short_time, long_time: τ₁ and τ₂, in rewards, at least 1, ``[runs]`` or one number.
    """
    short = means.short + (reward - means.short) / short_time
    return Means(short, means.long + (short - means.long) / long_time)


class Solution(NamedTuple):
    """A record of the mean reward r̿ over a stage of learning, each ``[runs]``.

    Attributes:
        steps: the steps since the stage began, int64.
        solved: whether r̿ has exceeded `SOLVED` of the best mean at a step after the first
            `SETTLING_STEPS`, bool.
        lowest: the lowest r̿ from that step on, as a share of the best mean; infinity if unsolved.
        later: the steps from that step on, int64.
        above: those among them at which r̿ exceeded `SOLVED` of the best mean, int64.
    """

    steps: Tensor
    solved: Tensor
    lowest: Tensor
    later: Tensor
    above: Tensor


def no_solution(like: Tensor) -> Solution:
    """Return the record at the beginning of a stage.

    Args:
        like: a tensor ``[runs]`` of the dtype of the rewards.
    """
    zero = torch.zeros_like(like, dtype=torch.int64)
    never = torch.zeros_like(like, dtype=torch.bool)
    return Solution(zero, never, torch.full_like(like, torch.inf), zero.clone(), zero.clone())


def watched(solution: Solution, share: Tensor) -> Solution:
    """Return the record after one more step.

    Args:
        solution: the record so far.
        share: r̿ after the step, as a share of the best mean, ``[runs]``.
    """
    steps = solution.steps + 1
    high = share > SOLVED
    solved = solution.solved | (high & (steps > SETTLING_STEPS))
    return Solution(
        steps,
        solved,
        torch.where(solved, torch.minimum(solution.lowest, share), solution.lowest),
        solution.later + solved.to(torch.int64),
        solution.above + (solved & high).to(torch.int64),
    )
