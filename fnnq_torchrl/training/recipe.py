"""The recipe of a job's steps, by which the engine finds programs that it has compiled before."""

import json
from dataclasses import asdict

from envs.core.registry import is_own
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.jobs import ASIDE, BATCHABLE

_OF_STATE = (*ASIDE, *BATCHABLE, "engine", "situations")
"""Keys that a step doesn't depend on: their values are in its inputs, or are no part of it."""


def recipe(config: Config, step: str, prior: str | None = None) -> str | None:
    """Return a text that, with our source code, determines a step of a job.

    Args:
        config: the job's configuration.
        step: the name of the step, ``learn`` or ``test``.
        prior: the digest of the files of prior knowledge, if any.

    Returns:
        The recipe; None if the step runs a user's own code, whose changes nobody can see.
    """
    settings = asdict(config)
    if is_own(config.env.kind) or is_own(config.value.kind):
        return None
    shapes_it = {key: value for key, value in settings.items() if key not in _OF_STATE}
    del shapes_it["evaluation"]["situations"]  # the starts are part of the state
    return json.dumps([step, prior, shapes_it], sort_keys=True)
