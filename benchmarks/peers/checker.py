"""Check the registered tasks with Stable-Baselines3's checker, in its own virtual environment.

python -m benchmarks.peers.checker
"""

import warnings

import gymnasium
from stable_baselines3.common.env_checker import check_env

import fnnq_torchrl  # noqa: F401  # registers the tasks
from fnnq_torchrl.launch.registration import TASKS


def main() -> None:
    for name in TASKS:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # the checker warns of what it doesn't like
            check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)
        print(f"{name}: fine")


if __name__ == "__main__":
    main()
