"""Recipes of steps: texts by which the engine finds the programs that it has compiled before."""

import json
from dataclasses import fields
from typing import Any

from envs.core.parameters import Parameters
from fnnq_torchrl.config.identity import ASIDE
from fnnq_torchrl.config.own import own_kinds
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.evaluation import world_of_tests
from fnnq_torchrl.training.jobs import BATCHABLE

_NOT_OF_THE_STEP = (*ASIDE, *BATCHABLE, "engine", "situations")
"""Keys that don't change a step's program: their values are inputs of the step, or aren't used."""


def recipe(config: Config, step: str, prior: str | None = None) -> str | None:
    """Return a text that, together with our source code, determines a step of a job.

    Args:
        config: the job's configuration.
        step: the name of the step, ``learn`` or ``test``.
        prior: the digest of the files of prior knowledge, if there are any.

    Returns:
        The recipe, or None if the step runs a user's own code, because it isn't known which other
        modules that code depends on.
    """
    if own_kinds(config, learner=step == "learn"):
        return None
    parts = {key: part for key, part in _settings(config).items() if key not in _NOT_OF_THE_STEP}
    if step == "test":
        parts["env"] = world_of_tests(config)
    parts["evaluation"] = config.evaluation.every  # the fixed starts are inputs, too
    return json.dumps([step, prior, parts], sort_keys=True, default=_settings)


def _settings(parameters: Parameters) -> dict[str, Any]:
    """Return the values of a dataclass's fields, without its cached properties."""
    items = fields(parameters)  # type: ignore[arg-type]  # every subclass is a dataclass
    return {item.name: vars(parameters)[item.name] for item in items}
