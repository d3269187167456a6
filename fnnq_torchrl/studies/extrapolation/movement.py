"""The movement of Q where states were seen, where none were, and beyond the field of view."""

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from .learners import Learner

STATES = torch.linspace(-1.5, 1.5, 301)
"""The bearings Δθ, in rad, at which Q is evaluated."""

Numbers = NDArray[np.float64]


class Regions(NamedTuple):
    """Regions of `STATES`, each a mask, bool ``[states]``."""

    seen: NDArray[np.bool_]
    unseen: NDArray[np.bool_]  # within the head's field of view
    beyond_seen: NDArray[np.bool_]  # farther out than the head reports, on the seen side
    beyond_unseen: NDArray[np.bool_]  # the same on the other side


def regions(learner: Learner) -> Regions:
    """Return the regions by what the head saw while learning on the left."""
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
    """Return the distance of Q from its start, per unit of its mean over the seen states.

        m(s) = √(meanₐ(Q(s, a) − Q₀(s, a))²),   m(s) / (mean of m over the seen states)

    Args:
        learner: the runs.
        page: the index of the evaluation.

    Returns:
        The movement at `STATES`, ``[runs, states]``. The mean is over the candidate actions a.
    """
    now, start = (learner.values(learner.weights(which), STATES) for which in (page, 0))
    moved = (now - start).double().square().mean(-1).sqrt().numpy()
    unit = moved[:, regions(learner).seen].mean(axis=1, keepdims=True)
    relative: Numbers = moved / unit
    return relative


def state_values(learner: Learner, page: int) -> Numbers:
    """Return V(s) = maxₐ Q(s, a) at `STATES`, ``[runs, states]``."""
    values: Numbers = learner.values(learner.weights(page), STATES).double().amax(-1).numpy()
    return values


def towards_the_ball(learner: Learner, page: int) -> tuple[Numbers, Numbers]:
    """Return the shares of states where the greedy action turns the robot towards the ball.

    Returns:
        The share of the seen states except straight ahead, and of the unseen states, ``[runs]``
        each.
    """
    where = regions(learner)
    # A positive Δv turns right, away from a ball at a positive Δθ.
    turns = (_greedy(learner, page) * STATES < 0).double().numpy()
    seen = where.seen & (STATES.abs().numpy() > 1e-6)
    return turns[:, seen].mean(axis=1), turns[:, where.unseen].mean(axis=1)


def greedy_change_beyond(learner: Learner, page: int) -> tuple[Numbers, Numbers]:
    """Return the change of the greedy action beyond the field of view from that at its edge.

    Returns:
        The mean difference |Δv − Δv(edge)| over the states beyond, on the seen side and on the
        other, ``[runs]`` each.
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
    """Return the greedy action Δv at `STATES`, ``[runs, states]``."""
    candidates = learner.network.candidates
    return candidates[learner.values(learner.weights(page), STATES).argmax(-1)]
