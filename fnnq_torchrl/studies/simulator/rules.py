"""What the rules of a job's runs recommend, read off their consequents."""

from itertools import product
from typing import NamedTuple

import numpy as np

from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.studies.experiments import Job, NoResults
from fnnq_torchrl.training.weights import load_checkpoint

SIDES = "front", "left", "right"
BALL = "far left", "left", "ahead", "right", "far right"
"""Where the ball is, by the labels of the bearing, which grows to the left."""


class Advice(NamedTuple):
    """What the rules of one situation say.

    Attributes:
        near: the sides on which something is near.
        steering: by where the ball is, the action label that most runs prefer, Δv, and the share of
            the runs that do.
    """

    near: tuple[str, ...]
    steering: dict[str, tuple[float, float]]


def read_rules(job: Job) -> list[Advice]:
    """Return what a job's runs have learned of `follow_obstacles`, for each combination of sides.

    Of the rules whose antecedents are the same but for the action, the one with the highest
    consequent is what a run prefers there.

    Raises:
        NoResults: the job has other rules.
        OSError, ValueError: its weights can't be read.
    """
    value = job.config.value
    names = ["bearing", *(f"sonar_{side}_m" for side in SIDES)]
    if not isinstance(value, LabelsConfig) or {*value.inputs} != {*names}:
        raise NoResults(f"{job.directory}: its rules aren't of {', '.join(names)}")
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
    """Δv in words: positive turns right."""
    side = "right" if steering > 0 else "left"
    return f"hard {side}" if abs(steering) > 0.7 else side
