"""Interference: the effect of one update at a state on Q at other states."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from .learners import Learner, Weights

SPACING_RAD = 0.05
FARTHEST_RAD = 1.0
"""The largest distance between two states; distances go up from 0 in steps of `SPACING_RAD`."""

Numbers = NDArray[np.float64]


def distances() -> Numbers:
    """Return the distances |s − s′| at which interference is measured, in rad."""
    return np.linspace(0, FARTHEST_RAD, round(FARTHEST_RAD / SPACING_RAD) + 1)


def interference(learner: Learner, page: int, actions: Tensor, alpha: float) -> Numbers:
    """Return |ΔQ(s′, a)| / |ΔQ(s, a)| after one update at (s, a), by the distance of s′ from s.

    The update is that of plain Q-learning with an error of one: Δw = α∇Q(s, a). Q is evaluated
    before and after it, so nothing is linearised. s is on a grid over the seen states, s′ on a grid
    over the whole field of view.

    Args:
        learner: the runs.
        page: the index of the evaluation whose weights are updated.
        actions: the actions a to average over.
        alpha: α of the update. It makes no difference where Q is linear in its weights.

    Returns:
        The ratio, ``[runs, distances]``: the mean over a and all pairs s, s′ at each distance.
    """
    world = learner.config.env
    view = round(world.field_of_view_rad / SPACING_RAD)
    other = round(min(world.other_view_rad, world.field_of_view_rad) / SPACING_RAD)
    places = torch.arange(-view, view + 1)
    weights = learner.weights(page)
    steps = len(distances())
    total, count = np.zeros((learner.runs, steps)), np.zeros(steps)
    for action in actions:
        here = action.expand(len(places))
        before = learner.values(weights, places * SPACING_RAD, here)
        for place in range(-other, view + 1):
            updated = _updated(learner, weights, torch.tensor([place * SPACING_RAD]), action, alpha)
            after = learner.values(updated, places * SPACING_RAD, here)
            moved = (after - before).abs().squeeze(-1).double().numpy()
            ratio = moved / moved[:, [place + view]]
            apart = (places - place).abs().numpy()
            for step in range(steps):
                there = apart == step
                total[:, step] += ratio[:, there].sum(axis=1)
                count[step] += there.sum()
    mean: Numbers = total / count
    return mean


def _updated(
    learner: Learner, weights: Weights, bearing_rad: Tensor, action: Tensor, alpha: float
) -> Weights:
    """Return the weights after one update of every run: w + α∇Q(s, a)."""
    leaves = {name: weight.clone().requires_grad_() for name, weight in weights.items()}
    with torch.enable_grad():
        # A run's Q depends on its own weights alone, so the gradient of the sum over the runs is
        # each run's gradient.
        total = learner.values(leaves, bearing_rad, action.view(1)).sum()
        slopes = torch.autograd.grad(total, list(leaves.values()))
    pairs = zip(weights.items(), slopes, strict=True)
    return {name: weight + alpha * slope for (name, weight), slope in pairs}
