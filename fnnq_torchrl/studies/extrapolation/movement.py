"""How far Q moved, where states were seen, where none was, and beyond what the head can see."""

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from .learners import Learner

STATES = torch.linspace(-1.5, 1.5, 301)
"""Δθ in rad, where Q is looked at."""

Numbers = NDArray[np.float64]


class Regions(NamedTuple):
    """Where on `STATES`, bool ``[states]`` each."""

    seen: NDArray[np.bool_]
    unseen: NDArray[np.bool_]  # within the head's field of view
    beyond_seen: NDArray[np.bool_]  # farther out than the head reports, on the seen side
    beyond_unseen: NDArray[np.bool_]  # the same on the other side


def regions(learner: Learner) -> Regions:
    """What is seen on the left: from the edge of the view to the right, to that to the left."""
    state, world = STATES.double().numpy(), learner.config.env
    view, other = world.field_of_view_rad, min(world.other_view_rad, world.field_of_view_rad)
    tiny = 1e-6  # the grid is in single precision
    seen = (state >= -other - tiny) & (state <= view + tiny)
    return Regions(
        seen=seen,
        unseen=(state >= -view - tiny) & ~seen & (state < 0),
        beyond_seen=state > view + tiny,
        beyond_unseen=state < -view - tiny,
    )


def movement(learner: Learner, page: int) -> Numbers:
    """How far Q is from where it started, per unit of the same where states were seen.

        m(s) = √(meanₐ(Q(s, a) − Q₀(s, a))²),   m(s) / (mean of m over the seen states)

    Args:
        learner: whose Q.
        page: the evaluation.

    Returns:
        ``[runs, states]`` of `STATES`, with the mean over the candidate actions a.
    """
    now, start = (learner.values(learner.weights(which), STATES) for which in (page, 0))
    moved = (now - start).double().square().mean(-1).sqrt().numpy()
    unit = moved[:, regions(learner).seen].mean(axis=1, keepdims=True)
    relative: Numbers = moved / unit
    return relative


def state_values(learner: Learner, page: int) -> Numbers:
    """V(s) = maxₐ Q(s, a) on `STATES`, ``[runs, states]``."""
    values: Numbers = learner.values(learner.weights(page), STATES).double().amax(-1).numpy()
    return values


def towards_the_ball(learner: Learner, page: int) -> tuple[Numbers, Numbers]:
    """In how many of the states the greedy action turns the robot towards the ball.

    Returns:
        The share of the seen states but straight ahead, and of the unseen ones, ``[runs]`` each.
    """
    where = regions(learner)
    turns = (
        (_greedy(learner, page) * STATES < 0).double().numpy()
    )  # a positive Δv turns right, from a positive Δθ
    seen = where.seen & (STATES.abs().numpy() > 1e-6)
    return turns[:, seen].mean(axis=1), turns[:, where.unseen].mean(axis=1)


def greedy_change_beyond(learner: Learner, page: int) -> tuple[Numbers, Numbers]:
    """How far the greedy action beyond the field of view is from that at its edge.

    Returns:
        The mean |Δv| over the states beyond, on the seen side and on the other, ``[runs]`` each.
    """
    where = regions(learner)
    greedy = _greedy(learner, page).double().numpy()
    inside = np.flatnonzero(where.seen | where.unseen)
    left, right = greedy[:, inside[-1:]], greedy[:, inside[:1]]
    return (
        np.abs(greedy[:, where.beyond_seen] - left).mean(axis=1),
        np.abs(greedy[:, where.beyond_unseen] - right).mean(axis=1),
    )


def _greedy(learner: Learner, page: int) -> Tensor:
    """The greedy action Δv on `STATES`, ``[runs, states]``."""
    candidates = learner.network.candidates
    return candidates[learner.values(learner.weights(page), STATES).argmax(-1)]
