"""Our learner: Q(λ) on the fuzzy rule base, as the command trains it.

python -m benchmarks.peers.fuzzy --steps 12000 lam=0.2 num_seeds=1000
"""

import argparse
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.trainer import Trainer

from .runs import Run, versions_of
from .task import moments


def enough(config: Config, steps: int) -> int:
    """Return a number of situations that takes at least that many steps, however fast they end."""
    every = config.evaluation.every
    return every * math.ceil(steps / config.env.fewest_steps / every)


def scores_at(
    moments: NDArray[np.int64], taken: NDArray[np.int64], catches: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return a run's score at some numbers of steps: that of its last evaluation before each.

    Args:
        moments: the numbers of steps.
        taken: the steps that the run had learned before each of its evaluations.
        catches: the score in each evaluation.
    """
    return catches[np.searchsorted(taken, moments, side="right") - 1]


def learn(steps: int, overrides: list[str]) -> Iterator[Run]:
    """Yield all runs of a batch. The wall time of each is its share of the batch's wall time."""
    situations = enough(load_config(*overrides), steps)
    config = load_config(*overrides, f"situations={situations}")
    trainer = Trainer.of(config)
    trainer.learn()
    outcome = trainer.evaluate()
    due = np.array(moments(steps))
    seconds = due * outcome.train_seconds / outcome.batch_learning_steps
    versions = versions_of("fnnq_torchrl", "torchrl", "torch")
    for seed, taken, catches in zip(outcome.seed, outcome.steps, outcome.catches, strict=True):
        yield Run(
            int(seed),
            due.tolist(),
            seconds.tolist(),
            scores_at(due, taken, catches).tolist(),
            versions,
            compile_seconds=outcome.compile_seconds / config.num_seeds,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("overrides", nargs="*", help="as of the command")
    given = parser.parse_args()
    for run in learn(given.steps, given.overrides):
        print(run.to_line())


if __name__ == "__main__":
    main()
