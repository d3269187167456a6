from itertools import product
from math import inf, nan

import pytest
import scipy.stats
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.equations.exploration import (
    annealed,
    boltzmann,
    boltzmann_probabilities,
    epsilon_greedy,
    epsilon_greedy_probabilities,
    is_greedy,
    noisy_greedy,
    normal_quantile,
)
from tests.oracles import peng

GRID = 840  # divisible by 1, …, 8, so that each of 1, …, 8 choices gets the same number of cells
DTYPES = pytest.mark.parametrize("dtype", [torch.float32, torch.float64])


def choose(values: list[float], epsilon: float, u: Tensor) -> Tensor:
    action_values = torch.tensor(values, dtype=u.dtype).unsqueeze(-1).expand(-1, len(u))
    return epsilon_greedy(action_values, torch.full_like(u, epsilon), u)


def grid(cells: int, dtype: torch.dtype) -> Tensor:
    return ((torch.arange(cells, dtype=torch.float64) + 0.5) / cells).to(dtype)


@DTYPES
@pytest.mark.parametrize("best", [pattern for pattern in product([0, 1], repeat=5) if any(pattern)])
def test_greedy_breaks_every_pattern_of_ties_evenly(
    best: tuple[int, ...], dtype: torch.dtype
) -> None:
    values = [0.25 if tied else -1.0 - i for i, tied in enumerate(best)]
    counts = choose(values, 0.0, grid(GRID, dtype)).bincount(minlength=5)
    assert counts.tolist() == [GRID // sum(best) * tied for tied in best]


@DTYPES
@pytest.mark.parametrize("epsilon", [0.1, 0.25, 0.5, 0.9])
def test_in_between_every_candidate_has_its_probability(epsilon: float, dtype: torch.dtype) -> None:
    # 2 of the 5 candidates are best. Each candidate has ε/5, and each best one (1 − ε)/2 more.
    cells = 20_000
    counts = choose([0, 7, 1, 7, -3], epsilon, grid(cells, dtype)).bincount(minlength=5)
    other, best = epsilon / 5, epsilon / 5 + (1 - epsilon) / 2
    expected = cells * torch.tensor([other, best, other, best, other])
    assert (counts - expected).abs().max() <= 2  # at the shares' edges


@DTYPES
def test_epsilon_one_is_uniform_whatever_the_values(dtype: torch.dtype) -> None:
    counts = choose([0, 9, 0, 0, 0, 0, 0], 1.0, grid(GRID, dtype)).bincount(minlength=7)
    assert counts.tolist() == [GRID // 7] * 7


@DTYPES
def test_every_run_has_its_own_epsilon_and_values(dtype: torch.dtype) -> None:
    values = torch.tensor([[0, 5, 5], [1, 0, 0], [0, 0, 5]], dtype=dtype)
    epsilon = torch.tensor([0.0, 1.0, 0.5], dtype=dtype)
    u = torch.tensor([0.4, 0.4, 0.8], dtype=dtype)
    # Runs: greedy; u in the second third of [0, 1); u = 0.8, which is 0.6 of the way from ε to 1
    # and so chooses the second of two.
    assert epsilon_greedy(values, epsilon, u).tolist() == [1, 1, 2]


@given(
    st.lists(st.sampled_from([-1.5, 0.0, 0.25, 3.0]), min_size=1, max_size=21),
    st.one_of(st.sampled_from([0.0, 0.1, 1.0]), st.floats(0, 1)),
    st.floats(0, 1, exclude_max=True),
)
def test_equals_the_plain_python_choice(values: list[float], epsilon: float, u: float) -> None:
    chosen = choose(values, epsilon, torch.tensor([u], dtype=torch.float64))
    assert chosen.item() == peng.epsilon_greedy(values, epsilon, u)


@DTYPES
@pytest.mark.parametrize("candidates", [1, 2, 3, 21, 101])
def test_the_choice_is_a_candidate_at_the_edges_of_the_uniform(
    candidates: int, dtype: torch.dtype
) -> None:
    one = torch.ones((), dtype=dtype)
    below_one = torch.nextafter(one, -one)
    epsilons = torch.stack([0 * one, 1e-7 * one, 0.1 * one, 0.5 * one, below_one, one])
    edges = torch.cat([torch.nextafter(epsilons, -one), epsilons, torch.nextafter(epsilons, one)])
    largest = torch.full((), 1 - 2.0**-24, dtype=dtype)  # the largest value of 24 random bits
    us = torch.cat([edges.clamp(0, below_one), largest.view(1), below_one.view(1)])
    epsilon, u = torch.cartesian_prod(epsilons, us).T
    for tied in (torch.zeros, torch.arange):
        values = tied(candidates, dtype=dtype).unsqueeze(-1).expand(-1, len(u))
        chosen = epsilon_greedy(values, epsilon, u)
        assert chosen.min() >= 0
        assert chosen.max() < candidates


@pytest.mark.parametrize("values", [[nan, nan, nan], [0.0, nan, 1.0], [inf, inf, 0.0], [-inf] * 3])
@pytest.mark.parametrize("epsilon", [0.0, 0.1, 1.0])
def test_the_choice_is_a_candidate_even_where_a_value_is_not_finite(
    values: list[float], epsilon: float
) -> None:
    chosen = choose(values, epsilon, grid(50, torch.float32))
    assert chosen.min() >= 0
    assert chosen.max() < 3


# -- Boltzmann ------------------------------------------------------------------------------------


def by_boltzmann(values: list[float], temperature: float, u: Tensor) -> Tensor:
    action_values = torch.tensor(values, dtype=u.dtype).unsqueeze(-1).expand(-1, len(u))
    return boltzmann(action_values, torch.full_like(u, temperature), u)


@DTYPES
@pytest.mark.parametrize("temperature", [0.1, 1.0, 10.0])
def test_boltzmann_gives_every_candidate_its_probability(
    temperature: float, dtype: torch.dtype
) -> None:
    values, cells = [0.0, 1.0, 0.5, 1.0, -3.0], 20_000
    counts = by_boltzmann(values, temperature, grid(cells, dtype)).bincount(minlength=5)
    expected = cells * torch.softmax(torch.tensor(values) / temperature, 0)
    assert (counts - expected).abs().max() <= 1


@DTYPES
def test_boltzmann_when_cold_is_greedy_and_when_hot_is_uniform(dtype: torch.dtype) -> None:
    values = [0.0, 0.25, -1e3, 0.25]
    cold = by_boltzmann(values, 1e-30, grid(GRID, dtype)).bincount(minlength=4)
    hot = by_boltzmann(values, 1e30, grid(GRID, dtype)).bincount(minlength=4)
    assert cold.tolist() == [0, GRID // 2, 0, GRID // 2]
    assert hot.tolist() == [GRID // 4] * 4


@DTYPES
@pytest.mark.parametrize(
    "values", [[0.0], [1.0, -1e9], [-1e9, 1.0], [0.3] * 21, [nan, nan], [inf, 0.0]]
)
def test_boltzmann_chooses_a_candidate_that_has_a_chance(
    values: list[float], dtype: torch.dtype
) -> None:
    below_one = torch.nextafter(torch.ones((), dtype=dtype), torch.zeros((), dtype=dtype))
    u = torch.stack([torch.zeros((), dtype=dtype), torch.full((), 1 - 2.0**-24), below_one])
    chosen = by_boltzmann(values, 0.1, u.to(dtype))
    assert chosen.min() >= 0
    assert chosen.max() < len(values)
    if -1e9 in values:
        assert (chosen == values.index(1.0)).all()


# -- noise ----------------------------------------------------------------------------------------


@DTYPES
def test_the_quantile_is_the_normal_distributions(dtype: torch.dtype) -> None:
    u = grid(20_000, dtype)
    expected = torch.from_numpy(scipy.stats.norm.ppf(u.double().numpy()))
    torch.testing.assert_close(normal_quantile(u).double(), expected, rtol=1e-4, atol=1e-4)
    edges = torch.tensor([0.0, 1.0], dtype=dtype)
    assert normal_quantile(edges).isfinite().all()


@DTYPES
def test_noise_is_normal_around_the_best(dtype: torch.dtype) -> None:
    candidates = torch.linspace(-1, 1, 5, dtype=dtype)
    u = grid(20_000, dtype)
    values = torch.tensor([0.0, 0.0, 3.0, 0.0, 0.0], dtype=dtype).unsqueeze(-1).expand(-1, len(u))
    action = noisy_greedy(values, candidates, torch.full_like(u, 0.2), u).double().numpy()
    assert scipy.stats.kstest(action, scipy.stats.norm(scale=0.2).cdf).statistic < 1e-3


@DTYPES
def test_ties_are_broken_evenly_before_the_noise_and_the_range_is_kept(dtype: torch.dtype) -> None:
    candidates = torch.linspace(-1, 1, 3, dtype=dtype)
    u = grid(6_000, dtype)
    values = torch.tensor([1.0, 0.0, 1.0], dtype=dtype).unsqueeze(-1).expand(-1, len(u))
    action = noisy_greedy(values, candidates, torch.full_like(u, 0.1), u)
    for centre in (-1, 1):
        near = action[(action - centre).abs() < 0.9]
        assert len(near) == 3_000
        assert (near == centre).sum() == pytest.approx(1_500, abs=2)  # half the noise goes beyond
        spread = (near - centre).square().mean().sqrt()
        assert spread == pytest.approx(0.1 / 2**0.5, rel=1e-2)
    assert torch.equal(
        noisy_greedy(values, candidates, torch.zeros_like(u), u),
        candidates[epsilon_greedy(values, torch.zeros_like(u), u)],
    )


def test_greedy_is_any_of_the_best_candidates() -> None:
    candidates = torch.tensor([-1.0, 0.0, 1.0])
    values = torch.tensor([2.0, 2.0, 0.0]).unsqueeze(-1).expand(-1, 4)
    action = torch.tensor([-1.0, 0.0, 1.0, 0.001])
    assert is_greedy(values, candidates, action).tolist() == [1, 1, 0, 0]


@pytest.mark.parametrize("epsilon", [0.0, 0.3, 1.0])
def test_the_probabilities_are_those_of_the_choices(epsilon: float) -> None:
    """Counted over 10,000 evenly spaced numbers u."""
    values = torch.tensor([1.0, 3.0, 3.0, -2.0], dtype=torch.float64)
    u = (torch.arange(10_000, dtype=torch.float64) + 0.5) / 10_000
    every = values.unsqueeze(-1).expand(-1, len(u))
    for choose, probabilities, amount in (
        (epsilon_greedy, epsilon_greedy_probabilities, epsilon),
        (boltzmann, boltzmann_probabilities, 0.5 + epsilon),
    ):
        amounts = torch.full_like(u, amount)
        counts = torch.bincount(choose(every, amounts, u).long(), minlength=4) / len(u)
        expected = probabilities(every, amounts)
        assert torch.equal(expected[:, 0], expected[:, -1])
        torch.testing.assert_close(counts.double(), expected[:, 0], rtol=0, atol=3e-4)


def test_annealing_is_linear_and_then_stays() -> None:
    first, final, over = (torch.tensor(x) for x in ([1.0, 0.1], [0.5, 0.1], [10.0, 1.0]))
    found = [annealed(first, final, over, torch.tensor(step)).tolist() for step in (0, 5, 10, 99)]
    assert [one for one, _ in found] == [1.0, 0.75, 0.5, 0.5]
    # ε is exactly the same where it doesn't change.
    assert {other for _, other in found} == {torch.tensor(0.1).item()}
