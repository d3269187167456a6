"""Read initial consequents (prior knowledge) from a file of rules."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.formats import read_system, read_text
from fnnq_torchrl.agent.rules.partition import Variable
from fnnq_torchrl.agent.rules.parts import Content, Definitions
from fnnq_torchrl.agent.rules.sentences import read_definitions, read_knowledge
from fnnq_torchrl.agent.rules.system import fit_words


def read_prior(
    path: Path,
    variables: Sequence[Variable],
    margin: float,
    t_norm: str = "product",
    elsewhere: str = "nearest",
) -> Tensor:
    """Read a network's initial consequents from a file of rules.

    A file in any readable format may hold a complete rule base of Q or a complete controller. A
    .txt file may also hold just some rules of either kind. Rules from state to action are turned
    into values by :func:`preferences`; a value given for the same rule takes precedence.

    Args:
        path: the file.
        variables: the network's state inputs and, last, the action.
        margin: the value of the right action, as in :func:`preferences`.
        t_norm, elsewhere: the network's settings.

    Returns:
        float64 ``[labels of input 1, …, action labels]``; 0 for rules that the file doesn't give.

    Raises:
        OSError: if the file can't be read.
        RulesError: if the ending is unknown, the file has a mistake, or its labels differ from the
            network's; the message gives the place.
    """
    if path.suffix.lower() == ".txt":
        known = read_knowledge(read_text(path), str(path), variables, t_norm, elsewhere)
        consequents = preferences(variables, known.actions, margin)
        for labels, value in known.values.items():
            consequents[labels] = value
        return consequents
    return from_content(read_system(path), variables, margin, t_norm, elsewhere)


def from_content(
    content: Content,
    variables: Sequence[Variable],
    margin: float,
    t_norm: str = "product",
    elsewhere: str = "nearest",
) -> Tensor:
    """Return a network's initial consequents from a complete rule base or controller.

    Args:
        content: Q, with the action as its last input, or a controller, with the action as its
            output.
        variables, margin, t_norm, elsewhere: as in :func:`read_prior`.

    Returns:
        float64 ``[labels of input 1, …, action labels]``.

    Raises:
        RulesError: if its inputs, labels, memberships or settings differ from the network's.
    """
    content.definitions.check(variables, t_norm, elsewhere)
    system, action = content.system, variables[-1]
    if len(system.inputs) == len(variables):
        return system.consequents.clone()
    if fit_words([system.output]) != fit_words([action.name]):
        raise content.definitions.error(
            f"its output is {system.output}; expected {action.name}, or {action.name} as its last "
            "input"
        )
    actions = {
        tuple(labels): float(system.consequents[tuple(labels)])
        for labels in torch.ones_like(system.consequents).nonzero().tolist()
    }
    return preferences(variables, actions, margin)


def definitions_of(path: Path) -> Definitions:
    """Read the variables and settings that a file of rules defines.

    Raises:
        OSError, RulesError: as in :func:`read_prior`.
    """
    if path.suffix.lower() == ".txt":
        return read_definitions(read_text(path), str(path))
    return read_system(path).definitions


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
