"""A check that a world can take a step and that its entries match its specs."""

from collections.abc import Iterable

import torch
from tensordict import TensorDictBase

from envs.core.parameters import ConfigError
from envs.core.pure import PureEnv


def check_world(env: PureEnv) -> None:
    """Reset, step and restart a world; raise an error if an entry doesn't match its spec.

    Args:
        env: the world, with at least two runs.

    Raises:
        ConfigError: if the world's code fails, an entry is missing or doesn't have the shape and
            dtype of its spec, or no ``success`` is returned for the measure ``successes``.
    """
    with torch.no_grad():
        try:
            start = env.reset()
            # env.step would repair missing or misshapen entries, and so hide the fault.
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
            f"env.kind={env.world.kind}: its transition must return success for the "
            "measure 'successes'; add it, or set measure = 'return' or 'length'"
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
        found = "missing" if entry is None else f"{entry.dtype} {list(entry.shape)}"
        if found != wanted:
            line = f"{when} the entry {key} is {found}; it must be {wanted}"
            raise ConfigError(f"env.kind={env.world.kind}: {line}")
