"""Imitation: fit consequents so that the best action is the one that an operator has chosen."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.func import functional_call

from fnnq_torchrl.agent.rules.errors import Place, shown
from fnnq_torchrl.agent.rules.formats import read_text
from fnnq_torchrl.agent.rules.partition import Variable
from fnnq_torchrl.agent.values import ValueNetwork

_SHARPNESS = 50.0  # β
_RIDGE = 1e-5  # ρ
_MOST_STEPS = 500


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """An operator's observations and actions.

    Attributes:
        states: float64 ``[steps, states]``.
        actions: float64 ``[steps]``.
    """

    states: Tensor
    actions: Tensor


@dataclass(frozen=True, eq=False)
class Imitation:
    """The result of :func:`imitate`.

    Attributes:
        weights: the network's fitted consequents, float64, in the shape of a single run.
        agreement: the share of the demonstrations in which the best candidate is the one nearest
            to the operator's action.
        mean_difference: the mean absolute difference between the best candidate and the operator's
            action.
    """

    weights: Tensor
    agreement: float
    mean_difference: float


def read_demonstrations(path: Path, variables: Sequence[Variable]) -> Demonstrations:
    """Read demonstrations from a CSV file with a header; other columns are ignored.

    Args:
        path: the file.
        variables: the state inputs and, last, the action; the file has a column for each name.

    Raises:
        OSError: if the file can't be read.
        RulesError: if the file has a mistake; the message gives the place.
    """
    rows = csv.reader(read_text(path).splitlines(), strict=True)
    names = [variable.name for variable in variables]
    low, high = variables[-1].low, variables[-1].high
    numbers: list[list[float]] = []
    try:
        head = [name.strip() for name in next(rows, [])]
        for name in names:
            if name not in head:
                expected = f"columns {', '.join(names)}"
                raise Place(str(path), 1).error(f"has no column {name}; expected {expected}")
        for name in head:
            if head.count(name) > 1 and name in names:
                raise Place(str(path), 1).error(f"has two columns {shown(name)}")
        places = [head.index(name) for name in names]
        for row in rows:
            if not row:
                continue
            line = Place(str(path), rows.line_num)
            if len(row) != len(head):
                raise line.error(f"has {len(row)} columns; expected {len(head)}")
            numbers.append([_number(row[i], head[i], line) for i in places])
            if not low <= numbers[-1][-1] <= high:
                allowed = f"expected a number in [{low:g}, {high:g}]"
                raise line.error(f"{names[-1]} {shown(row[places[-1]])}: {allowed}")
    except csv.Error as error:
        raise Place(str(path), max(1, rows.line_num)).error(f"is no CSV: {error}") from None
    if not numbers:
        raise Place(str(path), 1).error("expected rows of demonstrations")
    table = torch.tensor(numbers, dtype=torch.float64)
    return Demonstrations(table[:, :-1], table[:, -1])


def _number(text: str, name: str, place: Place) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise place.error(f"{name} {shown(text)}: expected a finite number")
    return value


def imitate(
    network: ValueNetwork,
    demonstrations: Demonstrations,
    *,
    margin: float,
    learns: Tensor | None = None,
) -> Imitation:
    """Fit a network's consequents to demonstrations.

    Let a_k be the candidate nearest to the operator's action, Δ(a) = margin · ((a − a_k)/d)² with d
    the range of the candidates, and w₀ the network's present consequents. The fit minimises ::

        mean over the steps of  log Σₐ exp(β(Q(s, a) + Δ(a) − Q(s, a_k))/margin) / β
            + ½ρ|(w − w₀)/margin|²

    by L-BFGS from w₀. The loss asks that each candidate be worth less than a_k by at least Δ(a). Q
    is linear in w, so there is a single minimum, independent of the steps' order. β = 50 and
    ρ = 10⁻⁵ are our choices: they make the loss a smooth hinge, and keep values from growing beyond
    the margins.

    Source: the large-margin loss of T. Hester et al., "Deep Q-learning from demonstrations", AAAI
    2018, smoothed as by K. Gimpel, N. A. Smith, "Softmax-margin CRFs", NAACL 2010.

    Args:
        network: a network of a single run, float64. Q must be linear in its only parameter,
            ``weight``, which holds w₀.
        demonstrations: the demonstrations to imitate.
        margin: the margin of Δ, in units of Q.
        learns: 1 for each consequent that is fitted and 0 for each that stays; all are fitted if
            not given.
    """
    from scipy.optimize import minimize  # here, since importing it is slow

    start = network.get_parameter("weight").detach().double()
    mask = torch.ones_like(start) if learns is None else learns.to(start).expand_as(start)
    candidates = network.candidates.double()
    states = [column.view(1, -1, 1) for column in demonstrations.states.unbind(-1)]
    distances = demonstrations.actions.unsqueeze(-1) - candidates
    chosen = distances.abs().argmin(-1, keepdim=True)
    span = float(candidates[-1] - candidates[0]) or 1.0
    due = ((candidates - candidates[chosen]) / span).square()  # Δ/margin, [steps, candidates]

    def values(weight: Tensor) -> Tensor:
        result: Tensor = functional_call(network, {"weight": weight}, tuple(states))
        return result.squeeze(0)

    @torch.enable_grad()
    def loss(moved: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        # In units of the margin, so that the optimiser sees numbers near 1.
        change = torch.from_numpy(moved).view_as(start).requires_grad_()
        q = values(start + margin * mask * change) / margin
        excess = torch.logsumexp(_SHARPNESS * (q + due - q.gather(-1, chosen)), -1) / _SHARPNESS
        total = excess.mean() + 0.5 * _RIDGE * change.square().sum()
        [slope] = torch.autograd.grad(total, change)
        return float(total.detach()), slope.flatten().numpy()

    options = {"maxiter": _MOST_STEPS, "gtol": 1e-9, "ftol": 0.0}
    found = minimize(loss, np.zeros(start.numel()), jac=True, method="L-BFGS-B", options=options)
    weights = start + margin * mask * torch.from_numpy(found.x).view_as(start)
    with torch.no_grad():
        best = values(weights).argmax(-1, keepdim=True)
    return Imitation(
        weights,
        float((best == chosen).double().mean()),
        float(distances.gather(-1, best).abs().mean()),
    )
