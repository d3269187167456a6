"""The pictures of the classic worlds show each thing at its place."""

from math import pi

import numpy as np
import pytest
import torch
from matplotlib.colors import to_rgb

from envs import make_world
from envs.canvas import BAD, GOOD, Canvas, Shot
from envs.classic.drawing import AcrobotShot, CarShot, PoleShot, RowShot
from envs.core.parameters import ConfigError
from envs.drawing import shot_of
from envs.shapes import INKS
from tests.compositions import config_of

SIZE_PX = 300
BODY, LINK = INKS["body"], INKS["link"]


def painted(shot: Shot, colour: str) -> tuple[float, float]:
    """Return the mean place (x, y) of a colour's pixels, as shares of the panel from its middle."""
    image = Canvas(size_px=SIZE_PX).draw([[shot]])[-SIZE_PX:]  # without the words above
    rows, columns = np.nonzero(np.abs(image / 255 - to_rgb(colour)).max(-1) < 0.02)
    assert len(rows), "nothing has that colour"
    return columns.mean() / SIZE_PX - 0.5, 0.5 - rows.mean() / SIZE_PX


def car(position: float) -> CarShot:
    return CarShot(position=position, velocity=0.0, road=(-1.2, 0.5), goal=0.5)


def test_the_car_is_on_the_road() -> None:
    """The valley's bottom is at −π/6; the road is as high 0.3 to its left as 0.3 to its right."""
    left, bottom, right = (painted(car(-pi / 6 + place), BODY) for place in (-0.3, 0.0, 0.3))
    assert bottom[0] == pytest.approx((-pi / 6 + 0.35) / 1.94, abs=0.02)
    assert left[0] < bottom[0] < right[0]
    assert left[1] == pytest.approx(right[1], abs=0.01)
    assert left[1] > bottom[1]


@pytest.mark.parametrize("angle_rad", [-0.2, 0.2])
def test_the_pole_leans_where_it_falls(angle_rad: float) -> None:
    shot = PoleShot(cart_m=0.0, pole_rad=angle_rad, track_m=2.4, largest_rad=0.21, pole_m=1.0)
    assert np.sign(painted(shot, LINK)[0]) == np.sign(angle_rad)


def test_the_links_end_where_their_angles_say() -> None:
    assert AcrobotShot(angle1_rad=0.0, angle2_rad=0.0).tip == pytest.approx((0, -2))
    assert AcrobotShot(angle1_rad=pi / 2, angle2_rad=0.0).tip == pytest.approx((2, 0))
    bent = AcrobotShot(angle1_rad=pi, angle2_rad=-pi / 2)
    assert (bent.joint, bent.tip) == (pytest.approx((0, 1)), pytest.approx((1, 1)))
    assert painted(bent, LINK) == pytest.approx((0.5 / 4.4, 1 / 4.4), abs=0.02)


def test_the_walker_is_in_its_state() -> None:
    places = [
        painted(RowShot(place=place, states=5, rewards=(-1.0, 1.0)), BODY)[0] for place in range(7)
    ]
    assert places[3] == pytest.approx(0, abs=0.01)
    np.testing.assert_allclose(np.diff(places), np.diff(places)[0], atol=0.01)


@pytest.mark.parametrize(
    "task",
    ["mountain_car", "cart_pole", "acrobot", "random_walk", "chain", "mountain_car_gymnasium"],
)
def test_every_drawn_world_has_a_picture(task: str) -> None:
    world = [f"env={task}"] if task.endswith("gymnasium") else []
    config = config_of(f"task={task.removesuffix('_gymnasium')}", *world)
    env = make_world(config.env, [2], seed=0)
    state = env.reset()
    first = shot_of(env, state, 1)
    after = env.step(env.rand_action(state))["next"]
    shot = shot_of(env, after, 1)
    assert (first.step, shot.step) == (0, 1)
    assert shot.reward == after["reward"][1].item()
    image = Canvas(2, 100, ["one", "other"]).draw([[first], [first, shot]])
    assert image.dtype == np.uint8
    assert image.std() > 5


def test_an_end_has_its_colour() -> None:
    for success, colour in ((True, GOOD), (False, BAD)):
        shot = RowShot(place=6, states=5, rewards=(None, 1.0), ended=True, success=success)
        painted(shot, colour)


def test_a_world_without_a_picture_is_told() -> None:
    env = make_world(config_of("task=two_states").env, [1], dtype=torch.float32)
    with pytest.raises(ConfigError, match=r"TwoStates has no picture; env\.kind=two_states"):
        shot_of(env, env.reset())
