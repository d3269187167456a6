"""The tasks for Gymnasium: ``gymnasium.make("fnnq/Follow-v0")`` after ``import fnnq_torchrl``."""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import TYPE_CHECKING, Any

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
    import gymnasium

    for name, task in TASKS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point=f"{__name__}:make",
                vector_entry_point=f"{__name__}:make_vector",
                kwargs={"task": task},
            )


def register_with_gymnasium() -> None:
    """Register the tasks now if Gymnasium is loaded, else as soon as it is.

    So a command that doesn't need Gymnasium doesn't wait for it.
    """
    if "gymnasium" in sys.modules:
        register_envs()
    else:
        sys.meta_path.insert(0, _AtImport())


class _AtImport(MetaPathFinder):
    """Registers the tasks at the end of Gymnasium's import."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != "gymnasium":
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            load = spec.loader.exec_module

            def load_and_register(module: ModuleType) -> None:
                sys.meta_path.remove(self)
                load(module)
                register_envs()

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


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
