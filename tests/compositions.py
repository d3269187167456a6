"""Configurations for the tests, in a fifth of the time of :func:`load_config`."""

from copy import deepcopy
from functools import cache

from hydra import compose
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.choices import choices_of
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.composition import started_hydra


def config_of(*overrides: str) -> Config:
    """Return what ``load_config`` returns for these valid overrides.

    Hydra composes the chosen files once; values are set in a copy, as Hydra does itself.
    """
    parsed = OverridesParser.create().parse_overrides([*overrides])
    node = deepcopy(_composed(*[str(each.input_line) for each in parsed if not _is_value(each)]))
    for each in filter(_is_value, parsed):
        OmegaConf.update(node, each.key_or_group, each.value(), merge=True)
    return to_config(node, own=True)


@cache
def _composed(*choices: str) -> DictConfig:
    with started_hydra():
        return compose("config", [*choices])


def _is_value(override: Override) -> bool:
    """Return whether an override sets a key of the configuration that is there."""
    key = override.key_or_group
    plain = not (override.is_add() or override.is_force_add() or override.is_delete())
    return (
        plain and override.package is None and not key.startswith("hydra") and not choices_of(key)
    )
