"""The settings and the command line of both peers' deep Q-networks (DQN).

The DQN is that of V. Mnih et al., "Human-level control through deep reinforcement learning", Nature
518, 2015, with Adam, the Huber loss, and settings for a small task, chosen beforehand. Only the
learning rate was tuned (tune.py).
"""

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass

from .runs import Run
from .task import STEPS


@dataclass(frozen=True)
class Settings:
    """The settings of a DQN. Those with a default are the same in both libraries."""

    learning_rate: float
    hidden: tuple[int, ...] = (64, 64)  # units of the hidden layers, with ReLU
    batch: int = 64  # transitions in an update
    buffer: int = STEPS  # transitions in the replay buffer: all of a run
    warm_up: int = 500  # steps with random actions before the first update
    collect: int = 4  # steps before each block of updates, and the number of updates in a block
    tau: float = 0.01  # weight of the new network in the target network's soft update
    epsilon: float = 0.1  # probability of a random action, the same as ours
    anneal: int = 2_000  # steps during which this probability falls from 1 to epsilon
    gradient_norm: float = 10.0  # the largest norm of a gradient


def command_line(learn: Callable[[Settings, int, int], Run]) -> None:
    """Learn the run that ``sys.argv`` specifies, and print it as one line of JSON.

    Args:
        learn: a function of the settings, the seed and the number of steps that returns a run.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--learning-rate", type=float, required=True)
    given = parser.parse_args()
    print(learn(Settings(given.learning_rate), given.seed, given.steps).to_line())


def in_words(settings: Settings) -> list[tuple[str, str]]:
    """Return the name and value of each setting except the learning rate."""
    values = asdict(settings).items()
    return [
        (name.replace("_", " "), f"{value:,}" if isinstance(value, int) else str(value))
        for name, value in values
        if name != "learning_rate"
    ]
