"""Imitation: consequents by which the best action is the one that an operator has chosen."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import minimize
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
    """What an operator saw and did.

    Attributes:
        states: float64 ``[steps, states]``.
        actions: float64 ``[steps]``.
    """

    states: Tensor
    actions: Tensor


@dataclass(frozen=True, eq=False)
class Imitation:
    """What came of a fit.

    Attributes:
        weights: of the network, float64, of the shape that it has for a single run.
        agreement: the share of the demonstrations in which the best candidate is the one that is
            nearest to the operator's action.
        mean_difference: between the best candidate and the operator's action.
    """

    weights: Tensor
    agreement: float
    mean_difference: float


def read_demonstrations(path: Path, variables: Sequence[Variable]) -> Demonstrations:
    """Read demonstrations from a CSV file with a header; columns of other names are passed over.

    Args:
        path: the file.
        variables: the state inputs and, last, the action: each has a column of its name.

    Raises:
        OSError: the file can't be read.
        RulesError: the place, and what is wrong there.
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

    With k the candidate that is nearest to the operator's action, Δ(a) = margin · ((a − a_k)/d)²,
    d the range of the candidates, and w₀ the consequents before, it minimises ::

        mean over the steps of  log Σₐ exp(β(Q(s, a) + Δ(a) − Q(s, a_k))/margin) / β
            + ½ρ|(w − w₀)/margin|²

    by L-BFGS from w₀: every candidate is to be worth less than the operator's by Δ. Q is linear in
    w, so that there is a single minimum, whatever the order of the steps. β = 50 and ρ = 10⁻⁵ are
    our choices: the loss is a smooth hinge, and values grow no further than the margins ask for.

    Source: the large-margin loss of T. Hester et al., "Deep Q-learning from demonstrations", AAAI
    2018, smoothed as by K. Gimpel, N. A. Smith, "Softmax-margin CRFs", NAACL 2010.

    Args:
        network: of a single run, float64, linear in its only parameter, ``weight``; has w₀.
        demonstrations: what to imitate.
        margin: in units of Q.
        learns: 1 for the consequents that are fitted and 0 for those that stay; all are if not
            given.
    """
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
        # In units of the margin, in which the numbers of the loss are near 1.
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
