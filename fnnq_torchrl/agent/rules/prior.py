"""The consequents that learning starts from, out of a file of rules."""

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
    """Read what a file says of the rules of a network.

    It may hold a whole rule base of values or a whole controller, in any readable format, or some
    sentences of either kind (.txt). What to do is turned into values by :func:`preferences`; where
    a sentence gives the value of such a rule too, that value counts.

    Args:
        path: the file.
        variables: the network's state inputs and, last, the action.
        margin: as of :func:`preferences`.
        t_norm: the network's.

    Returns:
        The consequents, float64 ``[labels of input 1, …, action labels]``; 0 where it says nothing.

    Raises:
        OSError: the file can't be read.
        RulesError: it can't be read by its ending, has a mistake, or is about other labels.
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
    """The consequents of a whole rule base or controller, if it has a network's labels.

    Args:
        system: of values, whose last input is the action, or a controller, whose output it is.
        variables, margin: as of :func:`read_prior`.
        name: where it comes from, for messages.
        t_norm: the network's.

    Raises:
        RulesError: it has other inputs, labels, memberships or another t-norm.
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
    """Values of rules of which it is known what to do.

    In a state where a* is to be done, the action label with its middle at a is worth margin ·
    (1 − ((a − a*)/d)²), where d is the distance between the outermost labels: the margin for a*, 0
    at the far end. Of a sum of such parabolas the best action is the weighted mean of the a*, as a
    Takagi–Sugeno controller of these rules would have it.

    Args:
        variables: the state inputs and, last, the action.
        actions: a*, by the places of the labels of the state inputs.
        margin: in units of the value.

    Returns:
        float64 ``[labels of input 1, …, action labels]``; 0 in all other states.
    """
    middles = torch.tensor(
        [label.function.middle(label.parameters) for label in variables[-1].labels]
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
    """Whether a system has these inputs, by the names that every format can hold."""
    return _fitted(system.inputs) == _fitted(variables)


def _fitted(variables: Sequence[Variable]) -> list[Any]:
    names = fit_words([variable.name for variable in variables])
    memberships = [
        [(label.kind, label.parameters) for label in variable.labels] for variable in variables
    ]
    labels = [fit_words(variable.names) for variable in variables]
    return [*zip(names, labels, memberships, strict=True)]


def _difference(system: FuzzySystem, variables: Sequence[Variable]) -> str:
    """The first way in which a system's inputs aren't a network's, and what to do about it."""
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
