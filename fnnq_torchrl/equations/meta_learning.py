"""Doya's meta-learning: a run changes its own α, temperature T and γ by trial and error.

Each parameter is a function of a level b. The levels are perturbed at random, and move along the
perturbations that came with a rise of the mean reward:

    r̄ ← r̄ + (r − r̄)/τ₁,   r̿ ← r̿ + (r̄ − r̿)/τ₂
    b₀ ← b₀ + μ(r̄ − r̿)σ,   b = b₀ + σ;   σ ~ N(0, 1), drawn again after every ``period`` rewards
    α = 1/(1 + eᵇ),   γ = 1/(1 + e⁻ᵇ),   1/T = eᵇ (exponential) or max(b + 1, 0) (affine)

The runs are the last dimension. Source: N. Schweighofer, K. Doya, "Meta-learning in reinforcement
learning", Neural Networks 16, 2003, with the equations of the replication by M. Sarazin,
M. Khamassi, I. Rano and B. Girard (draft for ReScience, 2018): the paper's equation of γ has a
misprint, and the paper states those of α and 1/T only in words.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from fnnq_torchrl.equations.names import ADAPTIVE_PARAMETERS, BETAS, CLOCKS
from fnnq_torchrl.equations.reward_means import Means, running_means

HIGHEST_LEVEL = 30.0
"""The bound of |b|: it keeps 1 − α, 1 − γ and T above 10⁻¹³, and all of them finite."""


class Link(NamedTuple):
    """A parameter as a function of its level b, and its inverse.

    Attributes:
        value: the parameter's value at a level.
        level: the level of a value.
        highest: the bound of |b|.
    """

    value: Callable[[Tensor], Tensor]
    level: Callable[[Tensor], Tensor]
    highest: float = HIGHEST_LEVEL


ALPHA = Link(lambda b: 1 / (1 + b.exp()), lambda alpha: (1 / alpha - 1).log())
GAMMA = Link(lambda b: 1 / (1 + (-b).exp()), lambda gamma: -(1 / gamma - 1).log())
TEMPERATURES = {
    "exponential": Link(lambda b: (-b).exp(), lambda temperature: -temperature.log()),
    "affine": Link(
        lambda b: 1 / (b + 1).clamp(min=0),  # infinite where the inverse temperature is 0
        lambda temperature: 1 / temperature - 1,
        math.exp(HIGHEST_LEVEL),
    ),
}
"""The links of the temperature, by the form of its inverse."""


class Rates(NamedTuple):
    """The settings of the scheme, each ``[runs]``.

    Attributes:
        rate: μ.
        period: the number of rewards from one perturbation to the next, at least 1.
        short_time, long_time: τ₁ and τ₂, in rewards, at least 1.
    """

    rate: Tensor
    period: Tensor
    short_time: Tensor
    long_time: Tensor


class Levels(NamedTuple):
    """The state of the scheme.

    Attributes:
        means: r̄ and r̿.
        level: b₀ of each adaptive parameter, ``[parameters, runs]``.
        perturbation: σ of each adaptive parameter, ``[parameters, runs]``.
        age: the number of rewards since σ was drawn, ``[runs]``, of the rewards' dtype.
        earned: the sum of the rewards since the last tick of the clock, ``[runs]``.
        bounded: whether a level has ever met its bound, bool ``[runs]``.
    """

    means: Means
    level: Tensor
    perturbation: Tensor
    age: Tensor
    earned: Tensor
    bounded: Tensor


class MetaLearning:
    """The scheme for some of α, T and γ.

    Args:
        parameters: the names of the parameters that it changes, at least one of
            :data:`.names.ADAPTIVE_PARAMETERS`; others stay as they are.
        beta: the form of the inverse temperature, ``exponential`` or ``affine``.
        clock: ``steps``: every step has a reward of its own. ``situations``: a situation's rewards
            count as one, their sum, when the situation ends.

    Attributes:
        parameters: the names of the parameters that it changes.

    Raises:
        ValueError: if there is no such parameter, form or clock.
    """

    def __init__(
        self,
        parameters: Sequence[str] = ADAPTIVE_PARAMETERS,
        beta: str = "exponential",
        clock: str = "steps",
    ) -> None:
        for name, given, choices in (
            *(("parameters", each, ADAPTIVE_PARAMETERS) for each in parameters or [""]),
            ("beta", beta, BETAS),
            ("clock", clock, CLOCKS),
        ):
            if given not in choices:
                *others, last = choices
                raise ValueError(f"{name}={given!r}: must be {', '.join(others)} or {last}")
        self.parameters = tuple(parameters)
        self._at_steps = clock == "steps"
        links = {"alpha": ALPHA, "temperature": TEMPERATURES[beta], "gamma": GAMMA}
        self._links = [links[name] for name in self.parameters]

    def start(self, values: Sequence[Tensor]) -> Levels:
        """Return the state before the first step.

        Args:
            values: the parameters' first values, in the order of `parameters`, each ``[runs]``.
        """
        levels = [
            link.level(value).clamp(-link.highest, link.highest)
            for link, value in zip(self._links, values, strict=True)
        ]
        level, zero = torch.stack(levels), torch.zeros_like(values[0])
        return Levels(
            Means(zero, zero.clone()),
            level,
            torch.zeros_like(level),
            zero.clone(),
            zero.clone(),
            torch.zeros_like(zero, dtype=torch.bool),
        )

    def update(
        self,
        levels: Levels,
        values: Sequence[Tensor],
        reward: Tensor,
        ended: Tensor,
        noise: Tensor,
        rates: Rates,
    ) -> tuple[Levels, list[Tensor]]:
        """Return the state and the parameters after a step.

        Args:
            levels: the state before the step.
            values: the parameters before the step, in the order of `parameters`, each ``[runs]``.
            reward: the step's reward, ``[runs]``.
            ended: whether a situation has ended with the step, bool ``[runs]``.
            noise: N(0, 1), used where σ is due, ``[parameters, runs]``.
            rates: the settings.

        Returns:
            The new state and the new values.
        """
        tick = torch.ones_like(ended) if self._at_steps else ended
        earned = levels.earned + reward
        short, long = running_means(levels.means, earned, rates.short_time, rates.long_time)
        sigma = torch.where(levels.age == 0, noise, levels.perturbation)
        age = levels.age + 1
        age = torch.where(age >= rates.period, 0, age)
        moved = (levels.level + (rates.rate * (short - long)) * sigma).unbind(0)
        bounded, kept, found = levels.bounded, [], []
        for link, level, perturbation in zip(self._links, moved, sigma.unbind(0), strict=True):
            mean = level.clamp(-link.highest, link.highest)
            present = mean + perturbation
            found.append(link.value(present.clamp(-link.highest, link.highest)))
            bounded = bounded | (tick & ((mean != level) | (present.abs() > link.highest)))
            kept.append(mean)

        def where_due(new: Tensor, old: Tensor) -> Tensor:
            return new if self._at_steps else torch.where(tick, new, old)

        after = Levels(
            Means(where_due(short, levels.means.short), where_due(long, levels.means.long)),
            where_due(torch.stack(kept), levels.level),
            where_due(sigma, levels.perturbation),
            where_due(age, levels.age),
            torch.where(tick, 0, earned),
            bounded,
        )
        return after, [where_due(new, old) for new, old in zip(found, values, strict=True)]
