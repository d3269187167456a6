import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from fnnq_torchrl.stats import mean_interval

SAMPLES = hnp.arrays(
    np.float64,
    hnp.array_shapes(min_dims=3, max_dims=3, min_side=2, max_side=4),
    elements=st.floats(-1e3, 1e3),
)


def test_known_numbers() -> None:
    # Mean 3, s = √2.5, t(0.975, 4) = 2.776445: half the width is 2.776445 · √(2.5 / 5).
    mean, low, high = mean_interval([1, 2, 3, 4, 5])
    assert mean == 3.0
    assert low == pytest.approx(3 - 1.963243, abs=1e-6)
    assert high == pytest.approx(3 + 1.963243, abs=1e-6)


@given(SAMPLES, st.integers(-3, 2), st.sampled_from([0.5, 0.9, 0.95, 0.99]))
def test_equals_scipy_along_every_axis(
    samples: NDArray[np.float64], axis: int, confidence: float
) -> None:
    mean, low, high = mean_interval(samples, axis=axis, confidence=confidence)
    cases = np.moveaxis(samples, axis, 0).reshape(samples.shape[axis], -1)
    spread = np.ptp(cases, axis=0) > 1e-6  # where there's none, scipy gives NaN or warns
    expected = scipy.stats.ttest_1samp(cases[:, spread], 0).confidence_interval(confidence)
    np.testing.assert_allclose(mean.ravel(), cases.mean(axis=0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(low.ravel()[spread], expected.low, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(high.ravel()[spread], expected.high, rtol=1e-7, atol=1e-7)


@given(st.floats(-1e6, 1e6), st.integers(2, 30))
def test_equal_samples_have_no_spread(value: float, n: int) -> None:
    assert mean_interval([value] * n) == (value, value, value)


def test_a_single_sample_has_a_mean_but_no_interval() -> None:
    mean, low, high = mean_interval(np.array([[1.0, 2.0]]))
    np.testing.assert_array_equal(mean, [1.0, 2.0])
    assert np.isnan([low, high]).all()


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_the_interval_covers_as_often_as_it_says(confidence: float) -> None:
    experiments, n = 20_000, 8
    samples = np.random.default_rng(2).normal(3.0, 2.0, size=(n, experiments))
    _, low, high = mean_interval(samples, confidence=confidence)
    covered = np.mean((low <= 3.0) & (high >= 3.0))
    # Four standard deviations of the binomial; the normal quantile in place of t's would miss
    # the 95 % by 25 of them.
    deviation = np.sqrt(confidence * (1 - confidence) / experiments)
    assert covered == pytest.approx(confidence, abs=4 * deviation)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0, float("nan")])
def test_confidence_is_a_probability(confidence: float) -> None:
    with pytest.raises(ValueError, match="confidence must lie between 0 and 1"):
        mean_interval([1.0, 2.0], confidence=confidence)


def test_no_samples_is_an_error() -> None:
    with pytest.raises(ValueError, match="at least one sample"):
        mean_interval(np.empty((0, 3)))
