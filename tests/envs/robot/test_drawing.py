"""The picture from above shows each thing at its place, in its colour."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from torchrl.envs import TransformedEnv, check_env_specs

from envs import canvas
from envs.canvas import Canvas
from envs.drawing import shot_of
from envs.pixels import Pixels
from envs.robot import drawing
from envs.robot.drawing import Shot, draw
from envs.worlds import make_world
from tests.compositions import config_of

SHOT = Shot(
    half_size_m=(3.0, 3.0),
    walls=True,
    pose=(0.0, 0.0, 0.0),
    radius_m=0.3,
    track_width_m=0.3,
    balls=[],
)


def painted(shot: Shot, colour: str) -> tuple[float, float]:
    """Return the mean position (x, y) of a colour's pixels, in metres."""
    image = Canvas(size_px=300).draw([[shot]])[-300:]  # without the words above
    rows, columns = np.nonzero(np.abs(image / 255 - to_rgb(colour)).max(-1) < 0.02)
    assert len(rows), "nothing has that colour"
    return (columns.mean() - 150) * 6.09 / 300, (150 - rows.mean()) * 6.09 / 300


@pytest.mark.parametrize(("x", "y"), [(2.0, 1.0), (-2.0, -1.5)])
def test_things_are_where_they_are(x, y):
    ball = replace(SHOT, balls=[(x, y, 0.3, "ball")])
    assert painted(ball, drawing.BALL) == pytest.approx((x, y), abs=0.1)
    disc = replace(SHOT, discs=[(x, y, 0.4)])
    assert painted(disc, drawing.OBSTACLE) == pytest.approx((x, y), abs=0.1)
    box = [(x - 0.5, y - 0.2), (x + 0.5, y - 0.2), (x + 0.5, y + 0.2), (x - 0.5, y + 0.2)]
    assert painted(replace(SHOT, boxes=[box]), drawing.OBSTACLE) == pytest.approx((x, y), abs=0.1)
    wheels = replace(SHOT, pose=(x, y, 0.4))
    assert painted(wheels, "0.2") == pytest.approx((x, y), abs=0.1)


def test_an_end_has_its_colour():
    painted(replace(SHOT, ended=True, success=True), canvas.GOOD)
    painted(replace(SHOT, ended=True), canvas.BAD)


@pytest.mark.parametrize("task", ["follow", "follow_obstacles", "wander"])
def test_every_world_of_the_robot_has_a_picture(task):
    env = make_world(config_of(f"task={task}").env, [2])
    state = env.step(env.rand_action(env.reset()))["next"]
    shot = shot_of(env, state, 1)
    assert shot.step == 1
    assert shot.pose[0] == state["x_m"][1].item()
    assert len(shot.beams) == (0 if task == "follow" else 8)
    assert len(shot.discs) == (0 if task == "follow" else 3)
    image = Canvas(2, 120, ["one", "other"]).draw([[shot], [shot, shot]])
    assert image.dtype == np.uint8
    assert image.shape[1:] == (240, 3)


def test_an_open_plane_is_shown_as_far_as_the_robot_drives():
    there = replace(SHOT, walls=False, pose=(-5.0, 1.0, 0.0))
    film = [replace(SHOT, walls=False), there]
    assert {shot.half_size_m for shot in Shot.in_view(film)} == {(5.4, 5.4)}
    walled = [SHOT, replace(SHOT, pose=(2.9, 0.0, 0.0))]
    assert Shot.in_view(walled) == walled


def test_a_bar_shows_the_scale():
    for half_m, length_m in ((3.0, 1.0), (0.9, 0.1), (25.0, 10.0)):
        axes = Figure().subplots()
        draw(axes, [replace(SHOT, half_size_m=(half_m, half_m))])
        [words] = [text.get_text() for text in axes.texts]
        assert words == f"{length_m:g} m"
        spans = [float(np.ptp(line.get_xdata())) for line in axes.lines]
        assert length_m in [round(span, 9) for span in spans]


def test_the_same_state_has_the_same_picture():
    env = make_world(config_of("task=wander").env, [1])
    shot = shot_of(env, env.reset())
    assert np.array_equal(Canvas(1, 100).draw([[shot]]), Canvas(1, 100).draw([[shot]]))


def test_torchrl_gets_pixels():
    env = TransformedEnv(make_world(config_of("task=wander").env, [2]), Pixels(60))
    check_env_specs(env)
    pixels = env.rollout(2)["next", "pixels"]
    assert pixels.shape[:2] == (2, 2)
    assert (pixels[0] != pixels[1]).any()


def test_the_users_settings_of_matplotlib_do_not_reach_a_picture():
    ball = replace(SHOT, balls=[(1.0, 1.0, 0.3, "ball")])
    usual = Canvas().draw([[ball, ball]])
    with rc_context({"text.usetex": True, "lines.linewidth": 9, "axes.facecolor": "red"}):
        assert np.array_equal(Canvas().draw([[ball, ball]]), usual)
