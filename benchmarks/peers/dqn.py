"""A deep Q-network as both peers have it: the same architecture and schedule, Adam, Huber's loss.

V. Mnih et al., "Human-level control through deep reinforcement learning", Nature 518, 2015, with
numbers for a small task that were set beforehand. Only the learning rate was sought (tune.py).
"""

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass

from .runs import Run
from .task import STEPS


@dataclass(frozen=True)
class Settings:
    """What is the same for both libraries, but for the learning rate, each's best."""

    learning_rate: float
    hidden: tuple[int, ...] = (64, 64)  # units of the layers between, with ReLU
    batch: int = 64  # transitions of an update
    buffer: int = STEPS  # all that it has lived through
    warm_up: int = 500  # steps before the first update, of random actions
    collect: int = 4  # steps, and then as many updates
    tau: float = 0.01  # of the way that the target network goes to the other at each step
    epsilon: float = 0.1  # probability of a random action, as ours
    anneal: int = 2_000  # steps in which it comes down to that from 1
    gradient_norm: float = 10.0  # at most


def command_line(learn: Callable[[Settings, int, int], Run]) -> None:
    """One run, by ``sys.argv``; prints it as a line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--learning-rate", type=float, required=True)
    given = parser.parse_args()
    print(learn(Settings(given.learning_rate), given.seed, given.steps).to_line())


def in_words(settings: Settings) -> list[tuple[str, str]]:
    """Each setting but the learning rate, by its name."""
    values = asdict(settings).items()
    return [
        (name.replace("_", " "), f"{value:,}" if isinstance(value, int) else str(value))
        for name, value in values
        if name != "learning_rate"
    ]
