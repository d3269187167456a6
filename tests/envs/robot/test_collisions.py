"""Collisions on the robot's way agree with a check of points along it, at any speed."""

from math import cos, hypot, sin

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from envs.robot.collisions import collides
from envs.robot.geometry import Walls
from tests.envs.robot.scenes import BOXES, DISCS, PLACE, boxes, discs, point
from tests.oracles import rays

RADIUS = 0.25


def gap_to_box(box: rays.Box, x: float, y: float) -> float:
    east, north = x - box.x, y - box.y
    across = abs(cos(box.heading) * east + sin(box.heading) * north) - box.width / 2
    up = abs(cos(box.heading) * north - sin(box.heading) * east) - box.height / 2
    return hypot(max(across, 0), max(up, 0))


@given(PLACE, PLACE, DISCS, BOXES)
def test_it_is_told_by_the_nearest_point_of_the_whole_way(start, end, round_ones, square_ones):
    gap = 9.0
    for x, y in way(start, end):
        gaps = [hypot(x - disc.x, y - disc.y) - disc.radius for disc in round_ones]
        gap = min([gap, *gaps, *(gap_to_box(box, x, y) for box in square_ones)])
    touched = collides(
        point(start), point(end), RADIUS, boxes=boxes(square_ones), discs=discs(round_ones)
    )
    spacing = hypot(end[0] - start[0], end[1] - start[1]) / 200
    if gap < RADIUS:
        assert touched
    if gap > RADIUS + spacing + 1e-9:
        assert not touched


def way(start, end):
    for number in range(201):
        share = number / 200
        yield start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


@pytest.mark.parametrize("speed", [0.1, 1, 10, 1000])
def test_no_speed_carries_a_robot_through_a_thin_wall(speed):
    board = boxes([rays.Box(1, 0, 0.001, 1, 0)])
    assert collides(point((1 - speed / 2, 0)), point((1 + speed / 2, 0)), RADIUS, boxes=board)
    assert not collides(point((0.2, -speed)), point((0.2, speed)), RADIUS, boxes=board)


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_the_walls_are_as_far_as_the_robot_is_wide(x, y):
    touched = collides(point((0, 0)), point((x, y)), RADIUS, walls=Walls(2, 1))
    assert bool(touched) == (abs(x) >= 1.75 or abs(y) >= 0.75)


def test_each_robot_has_its_own_obstacles():
    centres = torch.tensor([[1.0, 9.0], [9.0, 9.0]]).double()
    radii = torch.full((2, 2), 0.3).double()
    start, end = point((0, 0)), point((1, 0))
    start, end = (type(p)(p.x.expand(2), p.y.expand(2)) for p in (start, end))
    some = type(discs([rays.Disc(0, 0, 1)]))(centres, centres * 0, radii)
    assert collides(start, end, RADIUS, discs=some).tolist() == [True, False]
