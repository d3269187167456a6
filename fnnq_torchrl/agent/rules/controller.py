"""Distil a greedy policy into rules from state to action."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from math import prod

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.system import FuzzySystem

_POINTS = 2_001
_BISECTIONS = 50
_MOST_SLICES = 64


@dataclass(frozen=True)
class Stretch:
    """An interval of the first state input with the same greedy action.

    Attributes:
        low, high: the interval's ends.
        action: the greedy action.
        others: a label of each other state input by the input's name. The input is held at the
            label's middle.
    """

    low: float
    high: float
    action: float
    others: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Controller:
    """A greedy policy on a grid of states, and the rules that approximate it.

    Attributes:
        states: a grid over the state inputs' ranges, ``[points, states]``.
        greedy: the greedy action at each point, ``[points]``.
        policy: the greedy policy, a function from states ``[points, states]`` to ``[points]``; None
            if its action changes smoothly, so that there are no stretches of one action.
        distilled: the rules, with one action for each combination of the inputs' labels.
        action: the action's variable.
        largest_difference, mean_difference: the absolute difference between the rules' action and
            the greedy action, over the grid.
    """

    states: Tensor
    greedy: Tensor
    policy: Callable[[Tensor], Tensor] | None
    distilled: FuzzySystem
    action: Variable
    largest_difference: float
    mean_difference: float

    @cached_property
    def stretches(self) -> list[Stretch]:
        """The intervals of equal greedy action.

        The first state input moves over its range, for every combination of the other inputs'
        labels in turn. Empty if there are more than 64 combinations, or no policy.
        """
        first, *others = self.distilled.inputs
        if self.policy is None or prod(len(each.labels) for each in others) > _MOST_SLICES:
            return []
        x = torch.linspace(*first.span(), _POINTS, dtype=torch.float64)
        stretches = []
        for labels in product(*(other.labels for other in others)):
            held = x.new_tensor(
                [
                    min(max(label.function.middle(label.parameters), other.low), other.high)
                    for other, label in zip(others, labels, strict=True)
                ]
            )
            names = {other.name: label.name for other, label in zip(others, labels, strict=True)}
            stretches += _stretches(x, held, self.policy, names)
        return stretches

    @property
    def switches(self) -> list[Stretch]:
        """The stretches that begin at a state where the greedy action changes."""
        return [new for old, new in pairwise(self.stretches) if old.others == new.others]

    def sentences(self) -> list[str]:
        """Return the rules as sentences: ``if bearing is left then steer hard_left (+1.00)``."""
        return [
            f"if {self.distilled.premise(labels)} "
            f"then {self.action.name} {self.word(value)} ({value:+.2f})"
            for labels, value in self.distilled.rules()
        ]

    def word(self, action: float) -> str:
        """Return the name of the action label with the highest degree for a number."""
        degrees = self.action.log_degrees(torch.tensor(action, dtype=torch.float64), "nearest")
        label: Label = self.action.labels[int(degrees.argmax())]
        return label.name


def distil(
    states: Sequence[Variable],
    action: Variable,
    greedy: Callable[[Tensor], Tensor],
    t_norm: str = "product",
    elsewhere: str = "nearest",
) -> Controller:
    """Fit one action per state rule to a greedy policy, by least squares bounded by its range.

    Args:
        states: the state inputs.
        action: the action's variable; the fitted actions stay within its range.
        greedy: a function from states ``[points, states]`` to actions ``[points]``.
        t_norm, elsewhere: the rules' settings, as in :class:`.FuzzySystem`.
    """
    from scipy.optimize import lsq_linear  # here, since importing it is slow

    grid = _grid(states)
    actions = greedy(grid)
    zeros = torch.zeros([len(state.labels) for state in states], dtype=torch.float64)
    blank = FuzzySystem(tuple(states), action.name, zeros, t_norm, elsewhere)
    firing = blank.firing(grid).flatten(1)
    low, high = action.span()
    # The QR factors give the same least squares with one equation per rule, which is faster.
    turned, triangle = torch.linalg.qr(firing)
    fitted = lsq_linear(triangle.numpy(), (turned.T @ actions).numpy(), (low, high)).x
    numbers = torch.from_numpy(fitted).clamp(low, high).view_as(zeros)
    distilled = FuzzySystem(tuple(states), action.name, numbers, t_norm, elsewhere)
    differences = (distilled.evaluate(grid) - actions).abs()
    return Controller(
        grid,
        actions,
        greedy,
        distilled,
        action,
        float(differences.max()),
        float(differences.mean()),
    )


def exact(distilled: FuzzySystem, action: Variable) -> Controller:
    """Return the controller of a greedy policy that already has the form of such rules.

    Args:
        distilled: the rules, with one action for each combination of the inputs' labels.
        action: the action's variable.
    """
    grid = _grid(distilled.inputs)
    return Controller(grid, distilled.evaluate(grid), None, distilled, action, 0.0, 0.0)


def _grid(states: Sequence[Variable]) -> Tensor:
    """Return points over the state inputs' ranges, ``[points, states]``."""
    each = max(2, round(_POINTS ** (1 / len(states))))
    axes = [torch.linspace(*state.span(), each, dtype=torch.float64) for state in states]
    return torch.cartesian_prod(*axes).reshape(-1, len(states))


def _stretches(
    x: Tensor, held: Tensor, greedy: Callable[[Tensor], Tensor], names: Mapping[str, str]
) -> list[Stretch]:
    """Return the intervals of equal greedy action, with ends found by bisection between points.

    Args:
        x: rising numbers of the first state input, ``[points]``.
        held: the other state inputs' numbers, ``[state inputs − 1]``.
        greedy: as in :func:`distil`.
        names: the stretches' ``others``.
    """

    def best(first: Tensor) -> Tensor:
        return greedy(torch.cat([first.unsqueeze(-1), held.expand(len(first), -1)], dim=-1))

    actions = best(x)
    changes = (actions[1:] != actions[:-1]).nonzero().flatten()
    low, high = x[changes].clone(), x[changes + 1].clone()
    before = actions[changes]
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        same = best(middle) == before
        low, high = torch.where(same, middle, low), torch.where(same, high, middle)
    ends = [float(x[0]), *high.tolist(), float(x[-1])]
    values = [float(actions[0]), *actions[changes + 1].tolist()]
    return [
        Stretch(start, end, value, names)
        for (start, end), value in zip(pairwise(ends), values, strict=True)
    ]
