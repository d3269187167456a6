"""The robot's motion: wheels, circles, lines, and the differential equation behind them."""

import math
from dataclasses import dataclass

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from torch import Tensor

from envs.robot import kinematics

TRACK_WIDTH_M = 0.321
SPEED_MPS = 0.3
TIME_STEP_S = 0.1

steering = st.floats(-1, 1)
angle = st.floats(-10, 10)
place = st.floats(-5, 5)


@dataclass
class Pose:
    x_m: Tensor
    y_m: Tensor
    heading_rad: Tensor

    def after(self, steering: Tensor, time_step_s: float = TIME_STEP_S) -> "Pose":
        wheels = kinematics.wheel_speeds(steering, SPEED_MPS)
        pose = self.x_m, self.y_m, self.heading_rad
        return Pose(*kinematics.drive(*pose, *wheels, TRACK_WIDTH_M, time_step_s))


def real(number: float) -> Tensor:
    return torch.tensor(number, dtype=torch.float64)


def poses(x_m: float, y_m: float, heading_rad: float) -> Pose:
    return Pose(real(x_m), real(y_m), real(heading_rad))


def assert_close(one: Pose, other: Pose, atol: float = 1e-12) -> None:
    torch.testing.assert_close(vars(one), vars(other), rtol=0, atol=atol)


def test_wheel_speeds():
    left, right = kinematics.wheel_speeds(torch.tensor([-1, -0.5, 0, 0.5, 1]), 0.5)
    assert left.tolist() == [0, 0.25, 0.5, 0.75, 1]
    assert right.tolist() == [1, 0.75, 0.5, 0.25, 0]


@given(steering, place, place, angle)
def test_the_wheels_difference_turns_the_robot(dv, x, y, heading):
    """ω = −2·V₀·Δv/L, wherever the robot is."""
    after = poses(x, y, heading).after(real(dv))
    turn_rad = -2 * SPEED_MPS * dv / TRACK_WIDTH_M * TIME_STEP_S
    assert float(after.heading_rad) - heading == pytest.approx(turn_rad, abs=1e-14)


@pytest.mark.parametrize("side", [-1, 1], ids=["left", "right"])
def test_constant_steering_drives_a_circle(side):
    """The circle's radius is L/(2|Δv|), up to rounding, after any duration."""
    amount = torch.linspace(0.01, 1, 100, dtype=torch.float64)
    radius_m = TRACK_WIDTH_M / (2 * amount)
    start = pose = Pose(*(torch.full_like(amount, value) for value in (1.0, -2.0, 0.7)))
    # A positive Δv turns right: the centre lies at a right angle to the right of the heading.
    to_centre_rad = start.heading_rad - side * math.pi / 2
    centre_x_m = start.x_m + radius_m * torch.cos(to_centre_rad)
    centre_y_m = start.y_m + radius_m * torch.sin(to_centre_rad)
    for _ in range(1000):
        pose = pose.after(side * amount)
        distance_m = torch.hypot(pose.x_m - centre_x_m, pose.y_m - centre_y_m)
        torch.testing.assert_close(distance_m, radius_m, rtol=1e-12, atol=0)


@given(place, place, angle)
def test_no_steering_drives_a_straight_line(x, y, heading):
    start = pose = poses(x, y, heading)
    for _ in range(10):
        pose = pose.after(real(0))
    way_m = 10 * SPEED_MPS * TIME_STEP_S
    end = poses(x + way_m * math.cos(heading), y + way_m * math.sin(heading), heading)
    assert_close(pose, end)
    assert pose.heading_rad == start.heading_rad


@given(st.floats(-1e-4, 1e-4))
def test_hardly_any_steering_is_hardly_a_turn(dv):
    """The result equals the Taylor series of the arc; nothing is divided by nearly 0."""
    way_m = SPEED_MPS * TIME_STEP_S
    turn_rad = -2 * SPEED_MPS * dv / TRACK_WIDTH_M * TIME_STEP_S
    arc = poses(way_m * (1 - turn_rad**2 / 6), way_m * turn_rad / 2, turn_rad)
    assert_close(poses(0, 0, 0).after(real(dv)), arc, atol=1e-16)


@given(steering, place, place, angle, st.integers(1, 20), st.floats(0.01, 20))
def test_many_small_steps_make_one_large_step(dv, x, y, heading, count, duration_s):
    start = pose = poses(x, y, heading)
    for _ in range(count):
        pose = pose.after(real(dv), duration_s / count)
    assert_close(pose, start.after(real(dv), duration_s))


def test_it_solves_the_equation_of_motion():
    """A numerical integrator solves x' = v cos θ, y' = v sin θ, θ' = (v_right − v_left)/L."""
    course = torch.tensor([0.3, -1, 0, 0.05, 1, -0.4], dtype=torch.float64)
    pose = poses(0.1, 0.2, 0.3)
    state = [0.1, 0.2, 0.3]
    for dv in course:
        left, right = SPEED_MPS * (1 + dv), SPEED_MPS * (1 - dv)

        def motion(_, state, v=(left + right) / 2, omega=(right - left) / TRACK_WIDTH_M):
            return v * math.cos(state[2]), v * math.sin(state[2]), omega

        state = solve_ivp(motion, (0, 3), state, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        pose = pose.after(dv, 3)
        assert_close(pose, poses(*state), atol=1e-10)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_precision_and_shape_are_kept(dtype):
    pose = Pose(*torch.zeros(3, 2, 3, 1, dtype=dtype)).after(torch.ones(2, 3, 1, dtype=dtype))
    for value in vars(pose).values():
        assert value.dtype == dtype
        assert value.shape == (2, 3, 1)
