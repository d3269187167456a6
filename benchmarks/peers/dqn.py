"""The deep Q-network of both peers: the same architecture and schedule, Adam, the Huber loss.

V. Mnih et al., "Human-level control through deep reinforcement learning", Nature 518, 2015, with
settings for a small task that were chosen beforehand. Only the learning rate was tuned (tune.py).
"""

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass

from .runs import Run
from .task import STEPS


@dataclass(frozen=True)
class Settings:
    """The settings of both libraries' DQNs, the same but for the learning rate."""

    learning_rate: float
    hidden: tuple[int, ...] = (64, 64)  # units of the hidden layers, with ReLU
    batch: int = 64  # transitions in an update
    buffer: int = STEPS  # transitions kept: all of a run
    warm_up: int = 500  # steps with random actions before the first update
    collect: int = 4  # steps between updates, and then as many updates
    tau: float = 0.01  # share of the way that the target network moves at each update
    epsilon: float = 0.1  # probability of a random action, the same as ours
    anneal: int = 2_000  # steps in which that probability falls from 1 to epsilon
    gradient_norm: float = 10.0  # the largest norm of a gradient


def command_line(learn: Callable[[Settings, int, int], Run]) -> None:
    """Learn one run as ``sys.argv`` says, and print it as a line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--learning-rate", type=float, required=True)
    given = parser.parse_args()
    print(learn(Settings(given.learning_rate), given.seed, given.steps).to_line())


def in_words(settings: Settings) -> list[tuple[str, str]]:
    """Return the name and value of each setting but the learning rate."""
    values = asdict(settings).items()
    return [
        (name.replace("_", " "), f"{value:,}" if isinstance(value, int) else str(value))
        for name, value in values
        if name != "learning_rate"
    ]
