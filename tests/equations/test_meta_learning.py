"""Meta-learning: steps computed by hand, the links of its parameters, and its bounds."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.equations.meta_learning import (
    ALPHA,
    GAMMA,
    HIGHEST_LEVEL,
    TEMPERATURES,
    MetaLearning,
    Rates,
)


def numbers(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def no(runs: int = 1) -> Tensor:
    return torch.zeros(runs, dtype=torch.bool)


RATES = Rates(numbers(0.5), numbers(2), numbers(2), numbers(4))
"""μ = ½, a new perturbation after two rewards, τ₁ = 2, τ₂ = 4."""


def test_three_steps_by_hand() -> None:
    """A reward of 8 makes r̄ = 4, r̿ = 1; then 0 makes 2, 1.25; then 0 makes 1, 1.1875."""
    scheme = MetaLearning(["alpha", "gamma"])
    levels = scheme.start([numbers(0.5), numbers(0.5)])
    assert torch.equal(levels.level, torch.zeros(2, 1).double())
    noise = torch.tensor([[1.0], [-2.0]]).double()

    # b₀ = ½·(4 − 1)·σ = (1.5, −3), and b = (2.5, −5)
    levels, values = scheme.update(
        levels, [numbers(0.5), numbers(0.5)], numbers(8), no(), noise, RATES
    )
    assert levels.level.flatten().tolist() == [1.5, -3]
    torch.testing.assert_close(values[0], 1 / (1 + numbers(2.5).exp()))
    torch.testing.assert_close(values[1], 1 / (1 + numbers(5).exp()))

    # The perturbations stay: b₀ += ½·(2 − 1.25)·σ = (0.375, −0.75)
    levels, values = scheme.update(levels, values, numbers(0), no(), 9 * noise, RATES)
    assert levels.level.flatten().tolist() == [1.875, -3.75]

    # New perturbations: b₀ += ½·(1 − 1.1875)·σ = −0.09375·(2, 4)
    levels, values = scheme.update(levels, values, numbers(0), no(), numbers(2, 4)[:, None], RATES)
    assert (levels.means.short.item(), levels.means.long.item()) == (1, 1.1875)
    assert levels.level.flatten().tolist() == [1.6875, -4.125]
    torch.testing.assert_close(values[0], 1 / (1 + numbers(3.6875).exp()))


def test_a_clock_of_situations_waits_for_their_ends() -> None:
    scheme = MetaLearning(["alpha"], clock="situations")
    levels, alpha = scheme.start([numbers(0.5)]), [numbers(0.5)]
    noise = torch.ones(1, 1).double()
    for reward in (5, 2):
        before = levels
        levels, alpha = scheme.update(levels, alpha, numbers(reward), no(), noise, RATES)
        assert alpha[0] == 0.5
        assert (levels.means, levels.age) == (before.means, before.age)
    levels, alpha = scheme.update(levels, alpha, numbers(1), ~no(), noise, RATES)
    at_steps = MetaLearning(["alpha"])
    other, expected = at_steps.update(
        at_steps.start([numbers(0.5)]), [numbers(0.5)], numbers(8), no(), noise, RATES
    )
    assert alpha == expected
    assert (levels.means, levels.level, levels.earned) == (other.means, other.level, 0)


@given(st.floats(1e-9, 1 - 1e-9))
def test_the_levels_of_alpha_and_gamma_are_inverse(value: float) -> None:
    for link, there in ((ALPHA, 1 - value), (GAMMA, value)):
        level = link.level(numbers(value))
        torch.testing.assert_close(link.value(level), numbers(value), rtol=1e-7, atol=0)
        torch.testing.assert_close(torch.sigmoid(level), numbers(there), rtol=1e-6, atol=1e-12)


@given(st.floats(1e-6, 1e6))
def test_the_levels_of_the_temperature_are_inverse(value: float) -> None:
    for link in TEMPERATURES.values():
        found = link.value(link.level(numbers(value)))
        torch.testing.assert_close(found, numbers(value), rtol=1e-9, atol=0)


def test_an_inverse_temperature_below_zero_is_zero() -> None:
    assert TEMPERATURES["affine"].value(numbers(-3)).item() == torch.inf


@pytest.mark.parametrize("beta", TEMPERATURES)
@pytest.mark.parametrize("reward", [1e30, -1e30])
def test_extreme_rewards_move_levels_to_their_bounds_and_that_is_told(
    beta: str, reward: float
) -> None:
    scheme = MetaLearning(beta=beta)
    values = [numbers(0.5, 0.5).float()] * 3
    levels = scheme.start(values)
    rates = Rates(*(rate.float().expand(2) for rate in RATES))
    noise = torch.tensor([[1.0, 1.0], [1.0, -1.0], [1.0, -1.0]])
    assert not levels.bounded.any()
    rewards = torch.tensor([reward, 0.0])
    levels, values = scheme.update(levels, values, rewards, no(2), noise, rates)
    assert levels.bounded.tolist() == [True, False]
    alpha, temperature, gamma = values
    for each in (alpha, gamma):
        assert ((each >= 0) & (each <= 1)).all()
    assert (temperature > 0).all()
    assert not torch.stack(values).isnan().any()
    assert levels.level[0, 0].abs() == HIGHEST_LEVEL


def test_levels_of_useless_values_are_finite() -> None:
    for value in (0.0, 1.0):
        scheme = MetaLearning(["alpha", "gamma"])
        assert scheme.start([numbers(value)] * 2).level.isfinite().all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"parameters": ["alpha", "lam"]}, "parameters='lam': must be alpha, temperature or gamma"),
        ({"parameters": []}, "parameters='': must be alpha, temperature or gamma"),
        ({"beta": "linear"}, "beta='linear': must be exponential or affine"),
        ({"clock": "hours"}, "clock='hours': must be steps or situations"),
    ],
)
def test_unknown_settings_are_refused(settings: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        MetaLearning(**settings)
