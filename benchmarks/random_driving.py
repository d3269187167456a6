"""Many random steps in many random scenes: nothing overlaps, nothing is NaN, nothing out of range.

``python benchmarks/random_driving.py``, or ``make random-driving``: a million steps in 1,000 worlds
take some minutes. The test suite does the same with a few thousand.
"""

import argparse
import time

import torch

from envs.worlds import make_world
from fnnq_torchrl.launch.composition import load_config
from tests.envs.robot.scenes import check_state, full_scene


def main() -> None:
    """Drive, and stop at the first fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=1000)
    parser.add_argument("--steps", type=int, default=1_000_000)
    arguments = parser.parse_args()
    # A robot stops at what it touches, so it pushes against it from all sides.
    scene = full_scene(load_config("task=follow_obstacles").env)
    env = make_world(scene, [arguments.worlds])
    began, state = time.perf_counter(), env.reset()
    rounds = -(-arguments.steps // arguments.worlds)
    with torch.no_grad():
        for _ in range(rounds):
            state = env.restart(env.step(env.rand_action(state))["next"])
            check_state(env, state)
    took_s = time.perf_counter() - began
    print(
        f"{rounds * arguments.worlds:,} steps in {arguments.worlds:,} worlds, {took_s:.0f} s: fine"
    )


if __name__ == "__main__":
    main()
