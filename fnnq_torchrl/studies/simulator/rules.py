"""The distilled controllers of a job's runs, and what they do in the test."""

from itertools import product
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import NoResults
from fnnq_torchrl.studies.rules.comparison import Comparison
from fnnq_torchrl.studies.rules.replay import Replay

SIDES = "front", "left", "right"
BALL = "far left", "left", "ahead", "right", "far right"
"""The places of the ball, one for each label of the bearing, from left to right."""

PARTLY = 0.1, 0.5
"""Something is partly near if the rules about it fire with a share between these two."""

Numbers = NDArray[np.float64]


class Advice(NamedTuple):
    """The steering of the distilled controllers if something is near on some sides.

    Attributes:
        near: the sides on which something is near.
        steering: for each place of the ball, the action label that most runs' controllers name, in
            words, and the share of the runs that name it.
        steps: the firing strengths of these rules, summed over the steps of a run's test; the mean
            over the runs.
    """

    near: tuple[str, ...]
    steering: dict[str, tuple[str, float]]
    steps: float


class Outcomes(NamedTuple):
    """The ends of the test's situations, each ``[runs]``.

    Attributes:
        catches: the number of situations that end in a catch.
        collisions: the number that end in a collision.
        late: the number that reach the time limit.
    """

    catches: Numbers
    collisions: Numbers
    late: Numbers


class Steps(NamedTuple):
    """Steps of the learned controllers in the test, each ``[runs]``.

    Attributes:
        as_near: the number of the opposite steps in which the learned controller steers to the side
            that the distilled rules about something near name.
        opposite: the number of steps in which the distilled controller steers to the other side.
        all: the number of steps.
    """

    as_near: Numbers
    opposite: Numbers
    all: Numbers


def read_rules(compared: Comparison) -> list[Advice]:
    """Return the steering of the distilled controllers, for each set of near sides.

    Raises:
        NoResults: if the rules have other inputs than those of `follow_obstacles`.
    """
    controllers, order = compared.controllers, _order(compared)
    first = controllers[0]
    labels = {label.name: number for number, label in enumerate(first.action.labels)}
    words = [
        [labels[each.word(number)] for number in each.distilled.consequents.flatten().tolist()]
        for each in controllers
    ]
    shape = first.distilled.consequents.shape
    named = torch.tensor(words).reshape(-1, *shape).permute(0, *(axis + 1 for axis in order))
    states, _ = compared.learned.visited()
    fired = first.distilled.firing(states).sum(0).permute(order) / len(controllers)
    advice = []
    for front, left, right in product((0, 1), repeat=len(SIDES)):  # near and far
        steering = {}
        for number, place in enumerate(BALL):
            # The labels of the bearing rise from the right to the left.
            of_rule = named[:, len(BALL) - 1 - number, front, left, right]
            counts = of_rule.bincount(minlength=len(labels))
            name = [*labels][int(counts.argmax())].replace("_", " ")
            steering[place] = name, float(counts.max() / len(controllers))
        are_far = zip(SIDES, (front, left, right), strict=True)
        near = tuple(side for side, is_far in are_far if not is_far)
        advice.append(Advice(near, steering, float(fired[:, front, left, right].sum())))
    return sorted(advice, key=lambda each: len(each.near))


def outcomes(played: Replay, collision_reward: float) -> Outcomes:
    """Return how the situations of a replayed test of `follow_obstacles` ended.

    Args:
        played: the test; a situation has a reward at its end only.
        collision_reward: the reward of a collision.
    """
    caught = (played.after["success"].squeeze(-1) & played.counts).any(0)
    rewards = played.after["reward"].squeeze(-1).masked_fill(~played.counts, 0).sum(0)
    collided = ~caught & (rewards == collision_reward)
    ends = caught, collided, ~caught & ~collided
    return Outcomes(*(end.sum(-1).double().numpy() for end in ends))


def by_distance(compared: Comparison) -> tuple[Steps, Steps]:
    """Return the steps in which something is partly near, and the other steps."""
    axes = [0, *(axis + 1 for axis in _order(compared))]
    counts = []
    for run, controller in enumerate(compared.controllers):
        states, actions = compared.learned.visited(run)
        system = controller.distilled
        parts = (system.firing(states) * system.consequents).permute(axes)
        fires = system.firing(states).permute(axes)
        near = 1 - fires[:, :, 1, 1, 1].sum(-1)
        steers = parts.flatten(1).sum(-1)
        about_near = steers - parts[:, :, 1, 1, 1].sum(-1)
        opposite = steers * actions < 0
        as_near = opposite & (about_near * actions > 0)
        partly = (near > PARTLY[0]) & (near < PARTLY[1])
        counts.append(
            [
                [int((which & chosen).sum()) for which in (as_near, opposite, partly | ~partly)]
                for chosen in (partly, ~partly)
            ]
        )
    partly_counts, other_counts = np.array(counts, dtype=np.float64).transpose(1, 2, 0)
    return Steps(*partly_counts), Steps(*other_counts)


def _order(compared: Comparison) -> list[int]:
    """Return the places of bearing and of the sonars of :data:`SIDES` among the rules' inputs.

    Raises:
        NoResults: if the rules have other inputs.
    """
    inputs = [variable.name for variable in compared.controllers[0].distilled.inputs]
    names = ["bearing", *(f"sonar_{side}_m" for side in SIDES)]
    if {*inputs} != {*names}:
        raise NoResults(f"the rules must have the inputs {', '.join(names)}")
    return [inputs.index(name) for name in names]
