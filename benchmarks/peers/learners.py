"""The peers, and the commands that run them."""

import sys
from dataclasses import dataclass
from pathlib import Path

from .runs import Command

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Peer:
    """A library's DQN.

    Attributes:
        words: its name in figures and on the page.
        module: the module of this folder that runs it.
        python: the interpreter that has the library installed.
    """

    words: str
    module: str
    python: str

    def command(self, seed: int, steps: int, learning_rate: float) -> Command:
        """Return the command that prints one run."""
        given = {"seed": seed, "steps": steps, "learning-rate": learning_rate}
        options = [word for key, value in given.items() for word in (f"--{key}", str(value))]
        return [self.python, "-m", f"benchmarks.peers.{self.module}", *options]


PEERS = {
    "torchrl": Peer("DQN, TorchRL", "torchrl_dqn", sys.executable),
    "sb3": Peer("DQN, Stable-Baselines3", "sb3_dqn", str(FOLDER / ".venv" / "bin" / "python")),
}


def fuzzy_command(steps: int, *overrides: str) -> Command:
    """Return the command that prints our runs."""
    module = "benchmarks.peers.fuzzy"
    return [sys.executable, "-m", module, "--steps", str(steps), *overrides]
