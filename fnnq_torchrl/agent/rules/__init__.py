"""Rules that people read and write: rule bases, controllers, explanations, and their files."""

from fnnq_torchrl.agent.rules.choices import ChoiceRules
from fnnq_torchrl.agent.rules.controller import Controller
from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.explanation import Explanation
from fnnq_torchrl.agent.rules.of_network import rule_bases
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.rule_base import RuleBase, explain, partition
from fnnq_torchrl.agent.rules.system import FuzzySystem

__all__ = [
    "ChoiceRules",
    "Controller",
    "Explanation",
    "FuzzySystem",
    "Label",
    "RuleBase",
    "RulesError",
    "Variable",
    "explain",
    "partition",
    "rule_bases",
]
