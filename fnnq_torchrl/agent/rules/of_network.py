"""The rules of a value network."""

from collections.abc import Iterable
from dataclasses import replace
from typing import cast

from envs.core.world import WorldConfig
from fnnq_torchrl.agent.rules.choices import ChoiceRules
from fnnq_torchrl.agent.rules.rule_base import RuleBase
from fnnq_torchrl.agent.values import FNNQSumValue, FNNQValue, FuzzyQValue, ValueNetwork
from fnnq_torchrl.config.values import LabelsConfig


def rule_bases(
    network: ValueNetwork, config: LabelsConfig, world: WorldConfig, run: int | None = None
) -> tuple[RuleBase, ...]:
    """Return the rule bases of a network: several for a sum of rule bases, none without rules.

    Args:
        network, config, world, run: as in :meth:`RuleBase.from_network`.
    """
    if isinstance(network, FuzzyQValue):
        return (ChoiceRules.from_network(network, config, world, run),)
    if isinstance(network, FNNQValue):
        return (RuleBase.from_network(network, config, world, run),)
    if not isinstance(network, FNNQSumValue):
        return ()
    parts = []
    for part in cast(Iterable[FNNQValue], network.parts):
        of_part = replace(config, inputs={name: config.inputs[name] for name in part.in_keys})
        parts.append(RuleBase.from_network(part, of_part, world, run))
    return tuple(parts)
