import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from fnnq_torchrl.studies.statistics import (
    Statistic,
    bootstrap_interval,
    choose_by_half,
    improvement,
    interquartile_mean,
    paired_difference,
    runs_needed,
    standardised,
)
from fnnq_torchrl.training.intervals import mean_interval, student_t

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
    spread = np.ptp(cases, axis=0) > 1e-6  # without spread, scipy gives NaN or warns
    expected = scipy.stats.ttest_1samp(cases[:, spread], 0).confidence_interval(confidence)
    np.testing.assert_allclose(mean.ravel(), cases.mean(axis=0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(low.ravel()[spread], expected.low, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(high.ravel()[spread], expected.high, rtol=1e-7, atol=1e-7)


@given(st.integers(1, 20_000), st.floats(1e-3, 0.999))
def test_the_quantile_is_scipys(dof: int, confidence: float) -> None:
    expected = scipy.stats.t.ppf((1 + confidence) / 2, dof)
    assert student_t(dof, confidence) == pytest.approx(expected, rel=1e-9)


@given(st.floats(-1e6, 1e6), st.integers(2, 30))
def test_equal_samples_have_no_spread(value: float, n: int) -> None:
    assert mean_interval([value] * n) == (value, value, value)


@given(
    hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=2), elements=st.floats(-1, 5)),
    st.sampled_from([0.5, 0.95, 0.999]),
)
def test_an_interval_contains_its_mean_and_stays_within_the_bounds(
    samples: NDArray[np.float64], confidence: float
) -> None:
    mean, low, high = mean_interval(samples, confidence=confidence, bounds=(-1, 5))
    if len(samples) > 1:
        assert np.all((low >= -1) & (low <= mean) & (mean <= high) & (high <= 5))
    _, low_without, high_without = mean_interval(samples, confidence=confidence)
    np.testing.assert_array_equal(low, np.maximum(low_without, -1))
    np.testing.assert_array_equal(high, np.minimum(high_without, 5))


@pytest.mark.parametrize("score", [0, 3, 5])
def test_equal_scores_are_their_own_interval_at_the_bounds_too(score: int) -> None:
    assert mean_interval([score] * 4, bounds=(0, 5)) == (score, score, score)


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
    # The tolerance is four standard deviations of the binomial. The normal quantile in place of t's
    # would miss 95 % by 25 standard deviations.
    deviation = np.sqrt(confidence * (1 - confidence) / experiments)
    assert covered == pytest.approx(confidence, abs=4 * deviation)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95.0, float("nan")])
def test_confidence_is_a_probability(confidence: float) -> None:
    with pytest.raises(ValueError, match="confidence must lie between 0 and 1"):
        mean_interval([1.0, 2.0], confidence=confidence)


def test_no_samples_is_an_error() -> None:
    with pytest.raises(ValueError, match="at least one sample"):
        mean_interval(np.empty((0, 3)))


# -- bootstrap ------------------------------------------------------------------------------------


def lognormal(runs: int, seed: int = 3) -> NDArray[np.float64]:
    return np.random.default_rng(seed).lognormal(size=runs)


@pytest.mark.parametrize(("runs", "method"), [(40, "BCa"), (1500, "percentile")])
def test_the_interval_is_scipys(runs: int, method: str) -> None:
    sample = lognormal(runs)
    expected = scipy.stats.bootstrap(
        (sample,), np.mean, n_resamples=1000, method=method, rng=np.random.default_rng(7)
    ).confidence_interval
    assert bootstrap_interval(np.mean, sample, seed=7) == (sample.mean(), *expected)


def test_the_same_seed_gives_the_same_interval() -> None:
    sample = lognormal(30)
    same = [bootstrap_interval(interquartile_mean, sample, seed=seed) for seed in (1, 1, 2)]
    assert same[0] == same[1] != same[2]


@pytest.mark.parametrize("statistic", [np.mean, interquartile_mean])
def test_bootstrap_intervals_cover_as_often_as_they_say(statistic: Statistic) -> None:
    runs, experiments = 40, 400
    rng = np.random.default_rng(4)
    # Symmetric about 3, so that mean and interquartile mean have the same expectation.
    intervals = [bootstrap_interval(statistic, rng.normal(3, 2, runs)) for _ in range(experiments)]
    covered = np.mean([low <= 3 <= high for _, low, high in intervals])
    deviation = np.sqrt(0.95 * 0.05 / experiments)
    assert covered == pytest.approx(0.94, abs=3 * deviation)  # with few runs slightly below 0.95


def test_an_interval_where_no_run_matters_is_that_of_the_draws() -> None:
    # The middle half of the runs scores 5, so the mean of it is 5 whichever run is left out.
    sample = np.array([0.0, 0.0, *[5.0] * 18, 6.0, 6.0])
    value, low, high = bootstrap_interval(interquartile_mean, sample)
    assert value == 5.0
    assert low <= 5.0 <= high


def test_intervals_of_one_run_and_of_equal_runs() -> None:
    assert np.isnan(bootstrap_interval(np.mean, [2.0])[1:]).all()
    assert bootstrap_interval(np.mean, [2.0] * 5) == (2.0, 2.0, 2.0)


@settings(max_examples=20, deadline=None)
@given(hnp.arrays(np.float64, st.integers(2, 30), elements=st.integers(0, 5)))
def test_the_interval_of_a_bounded_score_stays_within_its_bounds(
    catches: NDArray[np.float64],
) -> None:
    _, low, high = bootstrap_interval(np.mean, catches, resamples=100)
    assert 0 <= low <= high <= 5


def test_the_interquartile_mean_by_hand() -> None:
    assert interquartile_mean([9.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -90.0]) == 3.5
    two = np.array([[0.0, 1.0, 2.0, 30.0], [5.0, 5.0, 7.0, 7.0]])
    np.testing.assert_array_equal(interquartile_mean(two), [1.5, 6.0])


# -- comparisons ----------------------------------------------------------------------------------


def test_the_probability_of_improvement_counts_all_pairs() -> None:
    # 3 beats 1 and 2; 1 draws with 1 and loses to 2; 2 beats 1 and draws with 2.
    assert improvement([3.0, 1.0, 2.0], [1.0, 2.0]) == pytest.approx((2 + 0.5 + 1.5) / 6)


@given(
    hnp.arrays(np.float64, st.integers(1, 12), elements=st.integers(0, 5)),
    hnp.arrays(np.float64, st.integers(1, 12), elements=st.integers(0, 5)),
)
def test_the_probability_of_improvement_is_mann_and_whitneys(
    ours: NDArray[np.float64], theirs: NDArray[np.float64]
) -> None:
    statistic = scipy.stats.mannwhitneyu(ours, theirs, method="asymptotic").statistic
    assert improvement(ours, theirs) == pytest.approx(statistic / (ours.size * theirs.size))
    assert improvement(theirs, ours) == pytest.approx(1 - improvement(ours, theirs))


def test_a_difference_of_normal_scores_is_as_in_closed_form() -> None:
    # Both scores of a run have a shared part of variance 1, and a part of their own of variance 1.
    rng = np.random.default_rng(5)
    runs = 4_000
    shared = rng.normal(size=runs)
    ours = 0.5 + shared + rng.normal(size=runs)
    theirs = shared + rng.normal(size=runs)
    difference = paired_difference(ours, theirs)
    mean, better = difference.mean, difference.improvement
    assert mean.low < 0.5 < mean.high
    # The shared part cancels in the pairs, so the interval is ±1.96·√2/√n.
    assert mean.high - mean.low == pytest.approx(2 * 1.96 * np.sqrt(2 / runs), rel=0.1)
    assert difference.effect == pytest.approx(0.5 / np.sqrt(2), abs=0.05)
    # For two independent runs the difference has the variance 4.
    assert better.low < scipy.stats.norm.cdf(0.5 / 2) < better.high


def test_runs_of_different_numbers_are_no_pairs() -> None:
    with pytest.raises(ValueError, match=r"ours \[2\] and theirs \[3\] must have the same"):
        paired_difference([1.0, 2.0], [1.0, 2.0, 3.0])


@pytest.mark.parametrize("effect", [0.05, 0.2, 0.5, 1.0, -0.5])
@pytest.mark.parametrize("power", [0.8, 0.95])
def test_so_many_runs_have_the_power_and_fewer_have_not(effect: float, power: float) -> None:
    def power_of(n: float) -> float:
        """Return the exact power of a t test, by the noncentral t distribution."""
        critical = scipy.stats.t.ppf(0.975, n - 1)
        return scipy.stats.nct.sf(critical, n - 1, abs(effect) * np.sqrt(n))

    needed = runs_needed(effect, power=power)
    assert power_of(needed + 1) >= power
    assert power_of(needed - 2) < power


def test_the_ends_of_what_can_be_seen() -> None:
    assert runs_needed(0.0) == np.inf
    assert runs_needed(np.inf) == 2
    assert np.isnan(runs_needed(float("nan")))
    assert standardised([1.0, 1.0, 1.0]) == np.inf
    assert standardised([0.0, 0.0]) == 0
    assert np.isnan(standardised([1.0]))


def test_a_choice_is_judged_by_runs_that_had_no_say_in_it() -> None:
    scores = [[1, 1, 1, 9, 9, 9], [2, 2, 2, 0, 1, 5]]
    choice, judged = choose_by_half(scores)
    assert (choice, judged.tolist()) == (1, [0, 1, 5])
    with pytest.raises(ValueError, match=r"^3 runs are too few"):
        choose_by_half([[1, 2, 3]])


def test_a_choice_that_diverged_is_never_the_best() -> None:
    diverged = [1, np.nan, 9, 9]
    assert choose_by_half([diverged, [2, 2, 3, 4], [1, 1, 5, 5]]).choice == 1
    assert choose_by_half([[0, 0, 1, 1], diverged]).choice == 0
    with pytest.raises(ValueError, match="every choice are NaN"):
        choose_by_half([diverged, diverged])
