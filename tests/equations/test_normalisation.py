"""Running means and variances, and the scale of rewards."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.equations.normalisation import Moments, RewardScale, normalised


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def nothing(runs: int = 1) -> Moments:
    return Moments(*(torch.zeros(runs, dtype=torch.float64) for _ in Moments._fields))


def moments_of(samples: list[float]) -> Moments:
    moments = nothing()
    for sample in samples:
        moments = moments.with_sample(real(sample))
    return moments


def test_three_samples_by_hand() -> None:
    moments = moments_of([2, 4, 9])  # mean 5, deviations −3, −1, 4
    assert [each.item() for each in moments] == pytest.approx([3, 5, 9 + 1 + 16])
    assert moments.variance.item() == pytest.approx(13)
    assert normalised(real(18), moments).item() == pytest.approx(13**0.5)


def test_before_two_samples_the_variance_is_one() -> None:
    assert nothing().variance.item() == moments_of([7]).variance.item() == 1
    assert normalised(real(7), moments_of([7])).item() == 0


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=40))
def test_they_are_the_mean_and_the_variance(samples: list[float]) -> None:
    moments = moments_of(samples)
    assert moments.mean.item() == pytest.approx(np.mean(samples), rel=1e-9, abs=1e-9)
    assert moments.variance.item() == pytest.approx(np.var(samples, ddof=1), rel=1e-9, abs=1e-9)


@given(st.floats(1e4, 1e6), st.lists(st.floats(-1, 1), min_size=20, max_size=20))
def test_a_large_mean_does_not_swallow_the_variance(mean: float, samples: list[float]) -> None:
    """The difference of the squares' mean and the mean's square would lose these digits."""
    moved = [mean + sample for sample in samples]
    assert moments_of(moved).variance.item() == pytest.approx(np.var(moved, ddof=1), abs=1e-8)


def test_rewards_by_hand() -> None:
    scale, gamma = RewardScale(real(0, 0), nothing(2)), real(0.5, 0.5)
    rewards = [real(1, 4), real(3, 0), real(2, 2)]
    ends = torch.tensor([[False, False], [True, False], [False, False]])
    scaled = []
    for reward, done in zip(rewards, ends, strict=True):
        scale = scale.with_reward(reward, gamma, done)
        scaled.append(scale.scaled(reward).tolist())
    # u of the run whose episode ends: 1, 3, 3.5; of the other: 4, 2, 3. Their variances with n − 1
    # are 1, 2, 7/4 and 1, 2, 1.
    assert torch.equal(scale.trace, real(3.5, 3))
    assert scaled[0] == pytest.approx([1, 4])
    assert scaled[1] == pytest.approx([3 / 2**0.5, 0])
    assert scaled[2] == pytest.approx([2 / (7 / 4) ** 0.5, 2])
