"""Run the authors' program of Stream Q(λ) in one of our tasks and print its episodes as JSON.

python -m benchmarks.stream_q.theirs --task cart_pole --seed 0 --steps 100000

The program isn't part of this repository: its licence is CC BY-NC. `make stream-q` gets it from its
own repository. It is written for Gymnasium 0.29; this module bridges what has changed since.
"""

import argparse
import json
import os
import pickle
import sys
import tempfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch

PROGRAM = Path(__file__).parents[1] / ".streaming-drl"
"""The folder of the program's repository."""

ENVIRONMENTS = {
    "cart_pole": "CartPole-v1",
    "acrobot": "Acrobot-v1",
    "follow": "fnnq/Follow-v0",
}
"""The name of each task in Gymnasium's registry."""


class RowsOfReturns(gymnasium.wrappers.RecordEpisodeStatistics):  # type: ignore[type-arg]
    """The wrapper of Gymnasium 0.29, which reports a return as an array of one number."""

    def step(self, action: Any) -> Any:
        *others, info = super().step(action)
        if "episode" in info:
            info["episode"]["r"] = np.array([info["episode"]["r"]])
        return *others, info


def run(task: str, seed: int, steps: int, limit: int | None = None) -> dict[str, Any]:
    """Return the program's episodes: the step at which each ended, and its return.

    Args:
        task: a key of `ENVIRONMENTS`.
        seed: the seed of the program.
        steps: the number of learning steps.
        limit: the time limit in steps; by default that of Gymnasium's registry. The program itself
            asks for 10,000.
    """
    sys.path.insert(0, str(PROGRAM))
    import stream_q

    if task == "follow":
        from fnnq_torchrl.launch.composition import load_config  # also registers the task

        limit = limit or load_config("task=follow").env.time_limit_steps
    make = gymnasium.make

    def make_with_our_limit(name: str, max_episode_steps: int, **settings: Any) -> Any:
        return make(name, max_episode_steps=limit, **settings)

    gymnasium.make = make_with_our_limit
    gymnasium.wrappers.RecordEpisodeStatistics = RowsOfReturns
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        stream_q.main(
            ENVIRONMENTS[task],
            seed,
            lr=1.0,
            gamma=0.99,
            lamda=0.8,
            total_steps=steps,
            epsilon_target=0.01,
            epsilon_start=1.0,
            exploration_fraction=0.05,
            kappa_value=2.0,
            debug=False,
            overshooting_info=False,
        )
        (file,) = Path(folder).rglob("*.pkl")
        returns, ends, _ = pickle.loads(file.read_bytes())  # noqa: S301  # written just now
    return {"seed": seed, "ends": ends, "returns": [float(each) for each in returns]}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--task", choices=ENVIRONMENTS, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--steps", type=int, required=True)
    parser.add_argument("--limit", type=int)
    print(json.dumps(run(**vars(parser.parse_args()))))
