"""The settings of the deep Q-networks, the same for both peers; Adam and Huber's loss.

V. Mnih et al., "Human-level control through deep reinforcement learning", Nature 518, 2015, with
numbers for a small task that were set in advance. Only the learning rate was tuned (tune.py).
"""

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass

from .runs import Run
from .task import STEPS


@dataclass(frozen=True)
class Settings:
    """The settings of both libraries; each has its own best learning rate."""

    learning_rate: float
    hidden: tuple[int, ...] = (64, 64)  # units of the hidden layers, with ReLU
    batch: int = 64  # transitions of an update
    buffer: int = STEPS  # holds all transitions of a run
    warm_up: int = 500  # steps before the first update, of random actions
    collect: int = 4  # steps between updates, and updates after them
    tau: float = 0.01  # share of the way to the network that the target moves at each step
    epsilon: float = 0.1  # probability of a random action, as ours
    anneal: int = 2_000  # steps in which it falls from 1 to that
    gradient_norm: float = 10.0  # at most


def command_line(learn: Callable[[Settings, int, int], Run]) -> None:
    """Learn one run as ``sys.argv`` says, and print it as a line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--learning-rate", type=float, required=True)
    given = parser.parse_args()
    print(learn(Settings(given.learning_rate), given.seed, given.steps).to_line())


def in_words(settings: Settings) -> list[tuple[str, str]]:
    """Return the names and values of all settings but the learning rate."""
    values = asdict(settings).items()
    return [
        (name.replace("_", " "), f"{value:,}" if isinstance(value, int) else str(value))
        for name, value in values
        if name != "learning_rate"
    ]
