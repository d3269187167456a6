"""The tasks for Gymnasium: ``gymnasium.make("fnnq/Follow-v0")`` after ``import fnnq_torchrl``."""

from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from envs.gymnasium import GymWorld, GymWorlds

TASKS = {
    "fnnq/Follow-v0": "follow",
    "fnnq/FollowObstacles-v0": "follow_obstacles",
    "fnnq/Wander-v0": "wander",
}
"""The tasks by their names in Gymnasium's registry."""


def register_envs() -> None:
    """Register the tasks of `TASKS`, each a single world and a vector of them."""
    for name, task in TASKS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"{__name__}:make",
                vector_entry_point=f"{__name__}:make_vector",
                kwargs={"task": task},
            )


def make(task: str, **settings: Any) -> "GymWorld":
    """Make a single world of a task with its candidate actions, all of ``conf/``."""
    from envs.gymnasium import GymWorld
    from fnnq_torchrl.launch.composition import load_config

    config = load_config(f"task={task}")
    return GymWorld(config.env, config.action.candidates, **settings)


def make_vector(num_envs: int, task: str, **_: Any) -> "GymWorlds":
    """Make so many worlds of a task that take their steps together."""
    from envs.gymnasium import GymWorlds
    from fnnq_torchrl.launch.composition import load_config

    config = load_config(f"task={task}")
    return GymWorlds(num_envs, config.env, config.action.candidates)
