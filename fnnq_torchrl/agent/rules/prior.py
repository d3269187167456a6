"""Read initial consequents (prior knowledge) from a file of rules."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.formats import read_system, read_text
from fnnq_torchrl.agent.rules.partition import Variable
from fnnq_torchrl.agent.rules.sentences import read_knowledge
from fnnq_torchrl.agent.rules.system import FuzzySystem, fit_words


def read_prior(
    path: Path, variables: Sequence[Variable], margin: float, t_norm: str = "product"
) -> Tensor:
    """Read a network's initial consequents from a file of rules.

    A file in any readable format may hold a complete rule base of Q or a complete controller. A
    .txt file may also hold just some rules of either kind. Rules from state to action are turned
    into values by :func:`preferences`; a value given for the same rule takes precedence.

    Args:
        path: the file.
        variables: the network's state inputs and, last, the action.
        margin: the value of the right action, as in :func:`preferences`.
        t_norm: the network's t-norm.

    Returns:
        float64 ``[labels of input 1, …, action labels]``; 0 for rules that the file doesn't give.

    Raises:
        OSError: if the file can't be read.
        RulesError: if the ending is unknown, the file has a mistake, or its labels differ from the
            network's.
    """
    if path.suffix.lower() == ".txt":
        known = read_knowledge(read_text(path), str(path), variables, t_norm)
        consequents = preferences(variables, known.actions, margin)
        for labels, value in known.values.items():
            consequents[labels] = value
        return consequents
    return from_system(read_system(path)[0], variables, margin, str(path), t_norm)


def from_system(
    system: FuzzySystem,
    variables: Sequence[Variable],
    margin: float,
    name: str,
    t_norm: str = "product",
) -> Tensor:
    """Return a network's initial consequents from a complete rule base or controller.

    Args:
        system: Q, with the action as its last input, or a controller, with it as the output.
        variables, margin: as in :func:`read_prior`.
        name: the system's origin, for messages.
        t_norm: the network's t-norm.

    Returns:
        float64 ``[labels of input 1, …, action labels]``.

    Raises:
        RulesError: if its inputs, labels, memberships or t-norm differ from the network's.
    """
    *states, action = variables
    if system.t_norm != t_norm:
        raise RulesError(
            f"{name}: its t-norm is {system.t_norm}, the network's is {t_norm}; "
            f"value.t_norm={system.t_norm} changes that"
        )
    if _same(system, variables):
        return system.consequents.clone()
    if fit_words([system.output]) == fit_words([action.name]) and _same(system, states):
        actions = {
            tuple(labels): float(system.consequents[tuple(labels)])
            for labels in _places(system.consequents)
        }
        return preferences(variables, actions, margin)
    raise RulesError(f"{name}: {_difference(system, variables)}")


def preferences(
    variables: Sequence[Variable], actions: Mapping[tuple[int, ...], float], margin: float
) -> Tensor:
    """Turn rules from state to action into values of Q.

    If the action for a state is a*, an action label with its middle at a gets the value margin ·
    (1 − ((a − a*)/d)²), where d is the distance between the outermost labels' middles. So a* itself
    is worth the margin, and an action at distance d is worth 0. The maximum of a weighted sum of
    such parabolas is the weighted mean of their a*, which is also the output of a Takagi–Sugeno
    controller with these rules.

    Args:
        variables: the state inputs and, last, the action.
        actions: a* by the indices of the state inputs' labels.
        margin: the value of a*.

    Returns:
        float64 ``[labels of input 1, …, action labels]``; 0 for states without an action.
    """
    middles = torch.tensor(
        [label.function.middle(label.parameters) for label in variables[-1].labels],
        dtype=torch.float32,
    ).double()
    values = torch.zeros([len(variable.labels) for variable in variables], dtype=torch.float64)
    span = float(middles.max() - middles.min()) or 1.0
    for labels, action in actions.items():
        values[labels] = margin * (1 - ((middles - action) / span) ** 2)
    return values


def _places(consequents: Tensor) -> list[list[int]]:
    found: list[list[int]] = torch.ones_like(consequents).nonzero().tolist()
    return found


def _same(system: FuzzySystem, variables: Sequence[Variable]) -> bool:
    """Return whether a system has these inputs; names are compared after :func:`.fit_words`."""
    return _fitted(system.inputs) == _fitted(variables)


def _fitted(variables: Sequence[Variable]) -> list[Any]:
    names = fit_words([variable.name for variable in variables])
    memberships = [
        [(label.kind, label.parameters) for label in variable.labels] for variable in variables
    ]
    labels = [fit_words(variable.names) for variable in variables]
    return [*zip(names, labels, memberships, strict=True)]


def _difference(system: FuzzySystem, variables: Sequence[Variable]) -> str:
    """Return a message: how a system's inputs differ from a network's, and the remedy."""
    ours, theirs = ([each.name for each in of] for of in (variables, system.inputs))
    if ours != theirs:
        return f"its inputs are {', '.join(theirs)}, the network's are {', '.join(ours)}"
    for own, other in zip(variables, system.inputs, strict=True):
        if own.names != other.names:
            return (
                f"its labels of {own.name} are {', '.join(other.names)}, the network's are "
                f"{', '.join(own.names)}; value.names.{own.name}=[{','.join(other.names)}] renames"
            )
        if own.labels != other.labels:
            break
    return (
        f"another partition: its memberships of {own.name} aren't the network's, which "
        "value.inputs=… and value.action=… set"
    )
