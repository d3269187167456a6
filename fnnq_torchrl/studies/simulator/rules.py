"""The steering that the rules of a job's runs prefer, according to their consequents."""

from itertools import product
from typing import NamedTuple

import numpy as np

from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.studies.experiments import Job, NoResults
from fnnq_torchrl.training.weights import load_checkpoint

SIDES = "front", "left", "right"
BALL = "far left", "left", "ahead", "right", "far right"
"""The places of the ball, one for each label of the bearing, from left to right."""


class Advice(NamedTuple):
    """The steering that the rules prefer if something is near on some sides.

    Attributes:
        near: the sides on which something is near.
        steering: for each place of the ball, (Δv, share): the centre of the action label that most
            runs prefer, and the share of the runs that prefer it.
    """

    near: tuple[str, ...]
    steering: dict[str, tuple[float, float]]


def read_rules(job: Job) -> list[Advice]:
    """Return the steering that a job of `follow_obstacles` has learned, for each set of near sides.

    Among rules that differ only in the action label, a run prefers the one with the highest
    consequent.

    Raises:
        NoResults: if the rules of the job have other inputs.
        OSError, ValueError: if its weights can't be read.
    """
    value = job.config.value
    names = ["bearing", *(f"sonar_{side}_m" for side in SIDES)]
    if not isinstance(value, LabelsConfig) or {*value.inputs} != {*names}:
        raise NoResults(f"{job.directory}: its rules must have the inputs {', '.join(names)}")
    weights = load_checkpoint(job.directory / "checkpoint.pt").weights["weight"].numpy()
    order = [[*value.inputs].index(name) + 1 for name in names]
    consequents = weights.transpose(0, *order, weights.ndim - 1)
    best = consequents.argmax(-1)  # [runs, bearing, front, left, right]
    advice = []
    for far in product((0, 1), repeat=len(SIDES)):
        steering = {}
        for number, place in enumerate(BALL):
            # The labels of the bearing rise from the right to the left.
            preferred = best[:, len(BALL) - 1 - number, *far]
            counts = np.bincount(preferred, minlength=len(value.action))
            label = int(counts.argmax())
            steering[place] = value.action[label][0], float(counts[label] / len(preferred))
        near = tuple(side for side, is_far in zip(SIDES, far, strict=True) if not is_far)
        advice.append(Advice(near, steering))
    return sorted(advice, key=lambda each: len(each.near))


def in_words(steering: float) -> str:
    """Return Δv in words; a positive Δv turns right."""
    side = "right" if steering > 0 else "left"
    return f"hard {side}" if abs(steering) > 0.7 else side
