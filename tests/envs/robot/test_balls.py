"""The ball's circle, and the points of the circle where situations begin."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from envs.core import streams
from envs.core.streams import Stream
from envs.robot import balls as ball

FAIR = 0.01  # samples are fixed, so a p-value above this stays above it
START_ANGLE_RAD = 0.9
SPEEDS_RADPS = 0.05, 0.15


@pytest.fixture(scope="module")
def starts():
    seed = torch.arange(2**14)
    words = streams.draw(seed, torch.zeros_like(seed), torch.zeros_like(seed), Stream.START)
    u, v, *_ = streams.uniform(words, torch.float64)
    return ball.random_start(u, v, streams.coin(words[1]), START_ANGLE_RAD, SPEEDS_RADPS)


def test_position():
    angle_rad = torch.tensor([0, math.pi / 2, math.pi, -math.pi / 2], dtype=torch.float64)
    x_m, y_m = ball.position(angle_rad, 1.5)
    assert x_m.tolist() == pytest.approx([1.5, 0, -1.5, 0], abs=1e-15)
    assert y_m.tolist() == pytest.approx([0, 1.5, 0, -1.5], abs=1e-15)


@given(st.floats(-4, 4), st.floats(-0.5, 0.5), st.floats(0.1, 10))
def test_the_ball_keeps_its_circle_and_its_speed(start_rad, speed_radps, radius_m):
    start = angle = torch.tensor(start_rad, dtype=torch.float64)
    speed = torch.tensor(speed_radps, dtype=torch.float64)
    before = ball.position(angle, radius_m)
    chord_m = 2 * radius_m * math.sin(abs(speed_radps) * 0.1 / 2)
    for _ in range(30):
        angle = ball.roll(angle, speed, 0.1)
        x_m, y_m = ball.position(angle, radius_m)
        assert math.hypot(x_m, y_m) == pytest.approx(radius_m, rel=1e-15)
        step_m = math.hypot(x_m - before[0], y_m - before[1])
        assert step_m == pytest.approx(chord_m, abs=1e-14 * radius_m)
        before = x_m, y_m
    assert float(angle - start) == pytest.approx(30 * 0.1 * speed_radps, abs=1e-13)


def test_random_starts_fill_their_ranges_evenly(starts):
    angle_rad, speed_radps = (start.numpy() for start in starts)
    low, high = SPEEDS_RADPS
    angles = stats.uniform(-START_ANGLE_RAD, 2 * START_ANGLE_RAD)
    speeds = stats.uniform(low, high - low)
    assert abs(angle_rad).max() <= START_ANGLE_RAD
    assert low <= abs(speed_radps).min()
    assert abs(speed_radps).max() <= high
    assert stats.kstest(angle_rad, angles.cdf).pvalue > FAIR
    assert stats.kstest(abs(speed_radps), speeds.cdf).pvalue > FAIR


def test_either_way_round_is_as_likely_and_independent_of_the_rest(starts):
    angle_rad, speed_radps = (start.numpy() for start in starts)
    left = speed_radps > 0
    assert stats.binomtest(int(left.sum()), len(left)).pvalue > FAIR
    assert stats.ks_2samp(speed_radps[left], -speed_radps[~left]).pvalue > FAIR
    assert stats.ks_2samp(angle_rad[left], angle_rad[~left]).pvalue > FAIR
    assert stats.spearmanr(angle_rad, abs(speed_radps)).pvalue > FAIR


def test_the_ends_of_the_ranges():
    ranges = 0.9, (0.05, 0.15)
    lowest, highest = torch.tensor([0, 1 - 2**-24], dtype=torch.float64)
    tails, heads = torch.tensor([False, True])
    angle_rad, speed_radps = ball.random_start(lowest, lowest, tails, *ranges)
    assert (float(angle_rad), float(speed_radps)) == (-0.9, -0.05)
    angle_rad, speed_radps = ball.random_start(highest, highest, heads, *ranges)
    assert (float(angle_rad), float(speed_radps)) == pytest.approx((0.9, 0.15), abs=1e-6)


def test_a_range_of_one_speed():
    u = torch.arange(2**16) * 2.0**-16
    _, speed_radps = ball.random_start(u, u, torch.ones_like(u).bool(), 0.0, (0.1, 0.1))
    assert speed_radps.unique().tolist() == torch.tensor([0.1]).tolist()
