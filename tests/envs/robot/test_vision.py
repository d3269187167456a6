"""The head's reading is wrapped, then noisy, then clipped."""

import math

import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st

from envs.robot import vision
from envs.robot.geometry import Discs
from tests.envs.robot.scenes import BOXES, DISCS, PLACE, boxes, discs, point, real
from tests.oracles import rays

angle = st.floats(-50, 50)


def bearing(
    to_ball_rad: float, heading_rad: float = 0, noise_rad: float = 0, view_rad: float = 1
) -> float:
    """Return the bearing of a ball in a given direction of the world."""
    angles = real(to_ball_rad), real(heading_rad), real(noise_rad)
    return float(vision.bearing(*angles, view_rad))


# -- wrap -----------------------------------------------------------------------------------------


@given(angle)
@example(math.pi)
@example(-math.pi)
@example(math.nextafter(-math.pi, -4))
def test_wrap_gives_the_same_angle_within_half_a_turn(angle_rad):
    wrapped = float(vision.wrap(real(angle_rad)))
    assert -math.pi <= wrapped <= math.pi
    assert math.remainder(wrapped - angle_rad, math.tau) == pytest.approx(0, abs=1e-13)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_half_a_turn_either_way_is_minus_pi(dtype):
    half = torch.tensor([math.pi, -math.pi], dtype=dtype)
    assert vision.wrap(half).equal(-half[:1].expand(2))


def test_wrap_leaves_an_angle_within_half_a_turn_alone():
    inside = torch.linspace(-3.14, 3.14, 1001, dtype=torch.float64)
    torch.testing.assert_close(vision.wrap(inside), inside, rtol=0, atol=1e-15)


# -- bearing --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("to_ball_rad", "heading_rad", "seen_rad"),
    [
        (0, 0, 0),  # straight ahead
        (0.3, 0, 0.3),  # to the left
        (-0.3, 0, -0.3),  # to the right
        (0.3, 0.5, -0.2),  # the robot's heading is further to the left
        (0.9, 0.2 + 6 * math.pi, 0.7),  # the robot has turned three times
        (-3, 3, 2 * math.pi - 6),  # across ±π
        (3, -3, 6 - 2 * math.pi),
    ],
)
def test_bearing_is_the_angle_from_the_heading_to_the_ball(to_ball_rad, heading_rad, seen_rad):
    assert bearing(to_ball_rad, heading_rad) == pytest.approx(seen_rad, abs=1e-14)


@given(st.floats(-1, 1), angle)
def test_only_the_angle_between_heading_and_ball_counts(true_rad, heading_rad):
    assert bearing(heading_rad + true_rad, heading_rad) == pytest.approx(true_rad, abs=1e-13)


@given(st.floats(1.001, 3.141), angle)
def test_a_ball_outside_the_view_is_at_the_edge_on_its_side(true_rad, heading_rad):
    assert bearing(heading_rad + true_rad, heading_rad) == 1
    assert bearing(heading_rad - true_rad, heading_rad) == -1


def test_a_ball_right_behind_is_on_one_side_or_the_other():
    behind = torch.tensor([[-2.0, 0.0], [-2.0, -0.0], [-2.0, 1e-6], [-2.0, -1e-6]]).double()
    direction_rad = torch.atan2(behind[:, 1], behind[:, 0])
    seen = vision.bearing(direction_rad, torch.zeros(4), torch.zeros(4), 1.0)
    assert seen.tolist() == [-1, -1, 1, -1]


@pytest.mark.parametrize(
    ("true_rad", "noise_rad", "seen_rad"),
    [
        (0.5, 0.01, 0.51),
        (0.995, 0.01, 1),  # the noise can't show more than the head's view
        (-0.995, -0.01, -1),
        (1.005, -0.01, 0.995),  # clipped first, this would be 0.99
        (-1.005, 0.01, -0.995),
        (1.005, 0.01, 1),
    ],
)
def test_noise_comes_before_the_edge(true_rad, noise_rad, seen_rad):
    assert bearing(true_rad, noise_rad=noise_rad) == pytest.approx(seen_rad, abs=1e-14)


def test_noise_comes_after_the_wrap():
    """A ball behind the robot, just on the left, is seen on the left with any noise."""
    assert bearing(math.pi - 0.001, noise_rad=0.01, view_rad=math.pi) == math.pi
    assert bearing(0.001 - math.pi, noise_rad=-0.01, view_rad=math.pi) == -math.pi


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_precision_and_shape_are_kept(dtype):
    seen = vision.bearing(*torch.ones(3, 2, 3, 1, dtype=dtype), 1.0)
    assert seen.dtype == dtype
    assert seen.shape == (2, 3, 1)


# -- what hides a ball ----------------------------------------------------------------------------


@given(PLACE, PLACE, DISCS, BOXES)
def test_a_ball_is_hidden_where_a_ray_to_it_meets_something(eye, spot, round_ones, square_ones):
    ball = Discs(real(spot[0])[None], real(spot[1])[None], real(0.1)[None])
    (hidden,) = vision.hidden(
        point(eye), ball, boxes=boxes(square_ones), discs=discs(round_ones)
    ).tolist()
    wider, narrower = (
        rays.blocked(
            eye,
            spot,
            [disc._replace(radius=disc.radius + grown) for disc in round_ones],
            [
                box._replace(width=box.width + grown, height=box.height + grown)
                for box in square_ones
            ],
        )
        for grown in (1e-6, -1e-6)
    )
    assert narrower <= hidden <= wider


def test_a_ball_hides_the_one_behind_it():
    balls = Discs(real([1, 2, 2]), real([0, 0.05, 0.5]), real([0.1, 0.1, 0.1]))
    assert vision.hidden(point((0, 0)), balls).tolist() == [False, True, False]


def test_what_is_in_sight():
    angle, distance = real([0.9, 1.1, -0.9, 0]), real([1, 1, 3, 3.1])
    seen = vision.in_sight(angle, distance, field_of_view_rad=1.0, range_m=3.0)
    assert seen.tolist() == [True, False, True, False]


def test_the_nearest_of_those_that_are_allowed():
    distance, name = real([[3.0], [1.0], [2.0]]), real([[0.0], [1.0], [2.0]])
    for allowed, picked in (
        ([True, True, True], [1, 1]),
        ([True, False, True], [2, 1]),
        ([True, False, False], [0, 1]),
        ([False, False, False], [0, 0]),
    ):
        found, least, which = vision.nearest(distance, torch.tensor(allowed)[:, None], name)
        assert [which.item(), found.item()] == picked
        assert least == distance[int(which)]


def test_the_resolution_rounds_to_the_nearest_multiple():
    angles = real([0.11, 0.14, -0.11, -0.16])
    assert vision.rounded(angles, 0.1).tolist() == pytest.approx([0.1, 0.1, -0.1, -0.2])
    assert vision.rounded(angles, 0) is angles
