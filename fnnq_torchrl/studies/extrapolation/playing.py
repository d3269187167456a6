"""The policies of the snapshots in the world: catches on either side, and visited states."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict
from torch import Tensor

from envs.worlds import make_world
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import make_policy
from fnnq_torchrl.engine.choice import make_engine
from fnnq_torchrl.engine.lanes import lanes_for
from fnnq_torchrl.engine.scheduler import work_through
from fnnq_torchrl.equations.names import EXPLORATIONS
from fnnq_torchrl.training.evaluation import GreedyTest, Playing, no_results

from .indifferent import IndifferentWhereUnseen
from .learners import Learner

ANGLES_RAD, SPEEDS_RADPS = (0.3, 0.45, 0.6, 0.75, 0.9), (0.1, -0.1)
"""The starts of the left side's tests: each angle with each speed of the ball."""

TESTS = len(ANGLES_RAD) * len(SPEEDS_RADPS)

_EVERY = 4

Numbers = NDArray[np.float64]


def starts(side: int) -> Tensor:
    """Return the starts of the ball (φ₀, ω_b) on the left (1) or, mirrored, on the right (−1).

    Returns:
        The starts in rad and rad/s, ``[tests, 2]``.
    """
    of_left = [(angle, speed) for angle in ANGLES_RAD for speed in SPEEDS_RADPS]
    return side * torch.tensor(of_left)


@torch.no_grad()
def catches(
    learner: Learner, pages: Sequence[int], side: int, *, indifferent: bool = False
) -> Numbers:
    """Return the number of a side's tests that the greedy policy ends in a catch.

    In the tests the head sees both sides.

    Args:
        learner: the runs.
        pages: the indices of the evaluations whose weights play.
        side: 1 for the left, where learning began, −1 for the right.
        indifferent: whether actions are random where nothing was seen while learning on the left.

    Returns:
        The catches, ``[runs, pages]``; 0 for a run that has diverged.
    """
    shape = (len(pages), learner.runs)
    network, prefix = learner.network, ""
    if indifferent:
        network, prefix = IndifferentWhereUnseen(network, learner.edge_rad), "network."
    saved = learner.snapshots.weights
    weights = {f"{prefix}{name}": weight[list(pages)] for name, weight in saved.items()}
    dtype = network.candidates.dtype
    results = no_results(*shape, TESTS, dtype)
    engine = make_engine("eager", torch.device("cpu"))
    lanes = lanes_for(results.numel(), engine.workers, engine.most_lanes)
    playing = Playing(
        GreedyTest(learner.config.env.tested, network, starts(side).to(dtype)),
        seed=learner.snapshots.seed.unsqueeze(-1),
        weights=TensorDict(weights, shape),
        results=results,
        engine=engine,
        lanes=lanes,
    )
    work_through(playing, playing.jobs, lanes, engine.workers)
    of_all: Numbers = results["success"].sum(-1).T.double().numpy()
    return np.where(learner.diverged[:, pages], 0.0, of_all)


@torch.no_grad()
def shares_beyond(learner: Learner, edges_rad: Sequence[float], whole_view: bool) -> Numbers:
    """Return the shares of the states visited in learning on the left that lie right of edges.

    Every fourth snapshot up to the switch plays the situation that came next, from the same start
    and with the same random numbers and exploration, but without learning.

    Args:
        learner: the runs, whose policies explore as they did while learning.
        edges_rad: the edges; a state counts if its Δθ is below the edge.
        whole_view: whether the head sees both sides, or only what it saw while learning.

    Returns:
        The shares, ``[runs, edges]``.
    """
    world = learner.config.env
    if whole_view:
        world = replace(world, other_view_rad=world.field_of_view_rad)
    situations = learner.snapshots.situations
    pages = (situations < world.switch_side_after).nonzero().flatten()[::_EVERY]
    lanes = len(pages) * learner.runs
    env = make_world(world, [lanes], dtype=learner.network.candidates.dtype)
    weights = {name: w[pages].flatten(0, 1) for name, w in learner.snapshots.weights.items()}
    config = learner.config
    exploring: float = getattr(config, EXPLORATIONS[config.exploration])
    policy = make_policy(config.exploration, learner.network, exploring)
    state = env.start(
        learner.snapshots.seed.repeat(len(pages)).unsqueeze(-1),
        situations[pages].repeat_interleave(learner.runs).unsqueeze(-1),
    )
    amount = torch.full_like(state["bearing"], exploring)
    goes_on = torch.ones_like(state["bearing"], dtype=torch.bool)
    edges = torch.tensor([*edges_rad, torch.inf])  # every state is below the last edge
    visits = torch.zeros(lanes, len(edges))
    for _ in range(world.time_limit_steps):
        visits += goes_on & (state["bearing"] < edges)
        after = env.step(act(policy, weights, amount, state))["next"]
        goes_on = goes_on & ~after["terminated"]
        state = after.select(*state.keys())
    counts = visits.view(len(pages), learner.runs, len(edges)).sum(0).double().numpy()
    shares: Numbers = counts[:, :-1] / counts[:, -1:]
    return shares
