"""The keys of the configuration that name code from outside this package."""

from typing import TYPE_CHECKING

from envs.core.registry import is_own

if TYPE_CHECKING:
    from fnnq_torchrl.config.schema import Config

LEARNER = ("exploration", "trace", "step_size")
"""The keys by which a learner names a class of the user's. Tests and pictures don't need these."""


def names_code(key: str, value: object) -> bool:
    """Return whether a key's value names code that would be imported, or is passed to such code.

    It is a user's class, an environment of Gymnasium with its module (``module:Name-v0``), or an
    argument of another library's class.

    Args:
        key: the key with its groups.
        value: its value.
    """
    named = is_own(value) and (key.endswith(".kind") or key in ("env.id", *LEARNER))
    return named or key.startswith("env.arguments.")


def own_kinds(config: "Config", *, learner: bool = True) -> dict[str, str]:
    """Return the user's classes that a configuration names, by their keys.

    Args:
        config: the configuration.
        learner: whether those of `LEARNER` are among them.
    """
    kinds: dict[str, str] = {"env.kind": config.env.kind, "value.kind": config.value.kind}
    if learner:
        kinds |= {key: getattr(config, key) for key in LEARNER}
    return {key: kind for key, kind in kinds.items() if is_own(kind)}
