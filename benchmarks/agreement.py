"""Compare the learning curves of eager and of compiled steps, over many runs.

python benchmarks/agreement.py [runs]

Eager and compiled steps differ in the last bits, so single runs diverge from each other sooner or
later. The average over the runs must be the same at every evaluation.
"""

import sys

import numpy as np
from machine import describe_machine

from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.trainer import Trainer


def learn(engine: str, runs: int) -> tuple[np.ndarray, float]:
    """Return the catches ``[runs, evaluations]`` and the seconds of learning."""
    trainer = Trainer.of(load_config("lam=0.2", f"num_seeds={runs}", f"engine={engine}"))
    trainer.learn()
    return trainer.evaluate().catches, trainer.ledger.seconds["train"]


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    (eager, eager_s), (compiled, compiled_s) = (learn(name, runs) for name in ("eager", "compiled"))
    # Both have the same seeds; paired differences have a narrower interval.
    differences = compiled - eager
    _, low, high = mean_interval(differences[:, 1:].mean(1))
    each = mean_interval(differences[:, 1:])
    apart = int(((each.low > 0) | (each.high < 0)).sum())
    print(describe_machine())
    print(f"{runs:,} runs, λ = 0.2, compiled against eager ({compiled_s:.0f} s, {eager_s:.0f} s)")
    print(f"  mean score    {compiled[:, 1:].mean():.3f} against {eager[:, 1:].mean():.3f}")
    print(f"  difference    95 % interval {low:+.4f} to {high:+.4f}")
    print(f"  evaluations   {apart} of {len(each.mean)} whose 95 % interval leaves 0 out")


if __name__ == "__main__":
    main()
