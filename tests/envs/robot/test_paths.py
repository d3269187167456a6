"""The balls' paths: values by hand, and properties of every bounce."""

from math import hypot, pi

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from envs.core.streams import Stream
from envs.robot import paths
from envs.robot.draws import Draws
from envs.robot.geometry import Walls
from envs.robot.scene import CircleConfig, LineConfig, StillConfig, WaypointsConfig
from tests.envs.robot.scenes import BOXES, boxes, point, real
from tests.oracles import rays

WALLS = Walls(2, 1.5)
SPEED = st.floats(-1, 1)


def start(path, runs: int = 1000) -> paths.Motion:
    seed = torch.arange(runs)
    return paths.start(path, Draws(seed, seed * 0, seed * 0, Stream.LAYOUT, torch.float64))


def test_a_circle():
    path = CircleConfig("circle", [1, 2], 0.5, [-1, 1], 0.2)
    motion = start(path)
    east, north = motion["x_m"] - 1, motion["y_m"] - 2
    assert torch.allclose(torch.hypot(east, north), real(0.5))
    angle = torch.atan2(north, east)
    assert angle.min() < -0.98
    assert angle.max() > 0.98
    after = paths.move(path, motion, 0.1, 0.1, WALLS, None)
    turned = torch.atan2(after["y_m"] - 2, after["x_m"] - 1)
    assert torch.allclose(turned, angle + 0.02)


def test_a_line_has_its_speed_in_its_direction():
    motion = start(LineConfig("line", [[0, 1], 0.5], [0, pi / 2], [0.1, 0.3]))
    assert (motion["y_m"] == 0.5).all()
    assert 0 <= motion["x_m"].min() < 0.01 < 0.99 < motion["x_m"].max() < 1
    speed = torch.hypot(motion["east_mps"], motion["north_mps"])
    assert 0.1 <= speed.min() < 0.11
    assert 0.29 < speed.max() <= 0.3
    assert motion["east_mps"].min() >= 0


def test_still_is_still():
    motion = start(StillConfig("still", [1, 2]))
    after = paths.move(StillConfig("still", [1, 2]), motion, 0.1, 0.1, WALLS, None)
    assert (after["x_m"] == 1).all()
    assert (after["y_m"] == 2).all()


@pytest.mark.parametrize(
    ("closed", "steps", "place"),
    [
        (True, 5, (0.5, 0)),
        (True, 15, (1, 0.5)),
        (True, 35, (0, 0.5)),
        (True, 45, (0.5, 0)),  # round again
        (False, 25, (0.5, 1)),
        (False, 50, (0, 1)),  # it stays at the last
    ],
)
def test_waypoints(closed, steps, place):
    path = WaypointsConfig("waypoints", [[0, 0], [1, 0], [1, 1], [0, 1]], 1.0, closed)
    motion = start(path, 1)
    for _ in range(steps):
        motion = paths.move(path, motion, 0.1, 0.1, WALLS, None)
    assert (motion["x_m"].item(), motion["y_m"].item()) == pytest.approx(place, abs=1e-9)


def test_a_wall_is_a_mirror():
    place, velocity = paths.bounce(point((1.8, 0)), point((0.5, 0.1)), 0.4, 0.1, WALLS, None)
    assert (place.x.item(), place.y.item()) == pytest.approx((1.8, 0.04))
    assert (velocity.x.item(), velocity.y.item()) == (-0.5, 0.1)


def test_a_boxs_side_is_a_mirror():
    box = boxes([rays.Box(1, 0, 0.4, 1, 0)])
    place, velocity = paths.bounce(point((0.6, 0)), point((1, 0.2)), 0.2, 0.1, WALLS, box)
    assert (place.x.item(), place.y.item()) == pytest.approx((0.6, 0.04))
    assert (velocity.x.item(), velocity.y.item()) == (-1, 0.2)


@given(st.tuples(st.floats(-1.9, 1.9), st.floats(-1.4, 1.4)), SPEED, SPEED, BOXES)
def test_a_ball_keeps_its_speed_and_stays_in_the_field_and_out_of_boxes(
    spot, east, north, square_ones
):
    place, velocity = point(spot), point((east, north))
    around = boxes(square_ones)
    wide = [box._replace(width=box.width + 0.2, height=box.height + 0.2) for box in square_ones]
    free = not any(box.holds(spot) for box in wide)
    for _ in range(20):
        place, velocity = paths.bounce(place, velocity, 0.5, 0.1, WALLS, around)
        x, y = place.x.item(), place.y.item()
        assert hypot(velocity.x.item(), velocity.y.item()) == pytest.approx(hypot(east, north))
        if free:
            assert abs(x) <= 1.9 + 1e-9
            assert abs(y) <= 1.4 + 1e-9
            shrunk = [b._replace(width=b.width - 1e-9, height=b.height - 1e-9) for b in wide]
            assert not any(box.holds((x, y)) for box in shrunk)


@given(SPEED, st.floats(0.1, 300))
def test_walls_fold_a_way_of_any_length(speed, seconds):
    """The folded way equals a reflection formula after any number of bounces."""
    quick, _ = paths.bounce(point((0.3, 0)), point((speed, 0)), seconds, 0.1, WALLS, None)
    unfolded = 0.3 + speed * seconds
    phase = (unfolded + 1.9) % 7.6
    assert quick.x.item() == pytest.approx(phase - 1.9 if phase <= 3.8 else 5.7 - phase, abs=1e-9)
