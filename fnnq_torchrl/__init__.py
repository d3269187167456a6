"""Peng's Q(λ) with the Q-function and its eligibility trace in a fuzzy neural network, in TorchRL.

A public name is imported when it is first used. So a configuration can be checked without importing
torch. Importing the package registers its tasks with Gymnasium, if that is installed.
"""

from importlib import import_module
from typing import Any

from fnnq_torchrl.launch.registration import register_with_gymnasium

_HOMES = {
    "BoltzmannPolicy": "agent.policy",
    "Config": "config.schema",
    "ConfigError": "config.schema",
    "EligibilityTrace": "agent.eligibility_trace",
    "EpsilonGreedyPolicy": "agent.policy",
    "ExploringPolicy": "agent.policy",
    "FNNQValue": "agent.values",
    "MLPValue": "agent.values",
    "NoisyPolicy": "agent.policy",
    "PengQLambdaLoss": "agent.loss",
    "Rule": "equations.q_lambda",
    "RuleBase": "agent.rules",
    "RBFValue": "agent.values",
    "StepSize": "equations.step_size",
    "Stepped": "equations.step_size",
    "TableValue": "agent.values",
    "TilesValue": "agent.values",
    "Trace": "equations.traces",
    "ValueConfig": "config.values",
    "ValueNetwork": "agent.values",
    "best_seed": "training.policies",
    "load_checkpoint": "training.weights",
    "load_config": "launch.composition",
    "load_policy": "training.policies",
    "load_results": "studies.results.frame",
    "load_rules": "training.policies",
    "load_snapshots": "training.weights",
    "make_candidates": "agent.candidates",
    "read_evaluations": "training.results",
    "read_summary": "training.results",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__


register_with_gymnasium()
