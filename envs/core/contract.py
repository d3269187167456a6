"""A check of a world, which takes one step and reports a fault in one line."""

from collections.abc import Iterable

import torch
from tensordict import TensorDictBase

from envs.core.parameters import ConfigError
from envs.core.pure import PureEnv


def check_world(env: PureEnv) -> None:
    """Take a step in a world, and refuse the world if an entry is missing or misshapen.

    Args:
        env: the world, with at least two runs.

    Raises:
        ConfigError: the step fails, or an entry is missing or doesn't have the shape and dtype of
            its spec.
    """
    with torch.no_grad():
        try:
            start = env.reset()
            # Not TorchRL's own step, which would mend what is wrong.
            after = env._step(env.rand_action(start))
            again = env.restart(after)
            said = env.transition({**start}, start["action"])
        except Exception as error:  # the world's own code may raise anything
            reason = " ".join(f"{type(error).__name__} {error}".split())
            raise ConfigError(
                f"env.kind={env.world.kind}: its first step fails: {reason}"
            ) from error
    if env.world.measure == "successes" and "success" not in said:
        raise ConfigError(
            f"env.kind={env.world.kind}: its transition returns no success, which its measure "
            "counts; return one, or set measure = 'return' or 'length'"
        )
    specs = {**env.observation_spec, **env.done_spec, "reward": env.reward_spec}
    carried = [key for key in env.observation_spec if key != "success"]
    for state, keys, when in (
        (start, carried, "after a reset"),
        (after, [*specs], "after a step"),
        (again, carried, "after a restart"),
    ):
        _check(env, state, keys, when)


def _check(env: PureEnv, state: TensorDictBase, keys: Iterable[str], when: str) -> None:
    specs = {**env.observation_spec, **env.done_spec, "reward": env.reward_spec}
    for key in keys:
        wanted = f"{specs[key].dtype} {list(specs[key].shape)}"
        entry = state.get(key, None)
        found = "not there" if entry is None else f"{entry.dtype} {list(entry.shape)}"
        if found != wanted:
            line = f"{when} {key} is {found}, and must be {wanted}"
            raise ConfigError(f"env.kind={env.world.kind}: {line}")
