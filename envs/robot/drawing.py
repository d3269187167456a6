"""Pictures of the robot's worlds from above, as in the paper's Fig. 1.

They show the robot, its sensors, the balls and the obstacles, and need no display. The worlds don't
import this module, so that only programs that draw load Matplotlib.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import ceil, cos, degrees, floor, log10, radians, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase

from envs.core.pure import PureEnv
from envs.pictures import (
    Axes,
    Circle,
    Figure,
    FigureCanvasAgg,
    Patch,
    Polygon,
    Rectangle,
    Wedge,
    own_style,
)
from envs.robot.arena import Arena
from envs.robot.follow import FollowBall
from envs.robot.geometry import Point

Image = NDArray[np.uint8]
"""An RGB picture, uint8 ``[height, width, 3]``."""

Spot = tuple[float, float]
"""x and y in m."""

Pose = tuple[float, float, float]
"""x and y in m, heading in rad."""

ROBOT, BALL, OTHER_BALL, OBSTACLE = "#0072B2", "#E69F00", "#CC79A7", "0.65"
ECHO, VIEW, GOOD, BAD = "#56B4E9", "#F5F0D0", "#009E73", "#D55E00"

_DPI = 100


_MARGIN_M = 0.4  # between the robot's way and the edge of the picture, in an open plane


@dataclass(frozen=True)
class Shot:
    """The visible state of one run at one step.

    Attributes:
        half_size_m: half the width and half the height of the region shown, around the origin.
        walls: whether the region's edges are walls.
        pose: the robot's x and y in m and its heading in rad.
        radius_m, track_width_m: the robot's radius and the distance between its wheels.
        balls: x, y and radius in m, and kind, of each ball.
        discs: x, y and radius in m of each round obstacle.
        boxes: the corners of each rectangular obstacle, in m.
        beams: x and y in m, direction and full width in rad, and reading in m, of each sonar.
        view_rad: the head's field of view to either side; None without a head.
        bearing_rad: the bearing that the head reports; None if it sees no ball.
        step: the number of steps so far.
        reward: the reward of this step.
        ended: whether the situation has ended.
        success: whether the situation has ended with a success.
    """

    half_size_m: Spot
    walls: bool
    pose: Pose
    radius_m: float
    track_width_m: float
    balls: list[tuple[float, float, float, str]]
    discs: list[tuple[float, ...]] = field(default_factory=list)
    boxes: list[list[Spot]] = field(default_factory=list)
    beams: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    view_rad: float | None = None
    bearing_rad: float | None = None
    step: int = 0
    reward: float = 0.0
    ended: bool = False
    success: bool = False


def shot_of(env: PureEnv, state: TensorDictBase, run: int = 0) -> Shot:
    """Return the visible state of one run of a batch.

    Args:
        env: one of the robot's worlds.
        state: the state of the whole batch after a reset or a step.
        run: the run's index in the flattened batch.

    Raises:
        TypeError: if ``env`` isn't one of the robot's worlds.
    """
    one = state.reshape(-1)[run : run + 1]
    if isinstance(env, FollowBall):
        shot = _of_ball(env, one)
    elif isinstance(env, Arena):
        shot = _of_arena(env, one)
    else:
        raise TypeError(f"{type(env).__name__} isn't a world of the robot: it has no picture")
    return replace(
        shot,
        step=int(one["step"]),
        reward=float(one.get("reward", 0.0)),
        ended=bool(one.get("done", False)),
        success=bool(one.get("success", False)),
    )


def in_view(film: Sequence[Shot]) -> list[Shot]:
    """Return the shots of a film with a region that contains the robot's whole way.

    Between walls, the region stays as it is.
    """
    [half_size_m] = {shot.half_size_m for shot in film}
    if not film[0].walls:
        farthest_m = max(abs(place_m) for shot in film for place_m in shot.pose[:2]) + _MARGIN_M
        half_size_m = max(half_size_m[0], farthest_m), max(half_size_m[1], farthest_m)
    return [replace(shot, half_size_m=half_size_m) for shot in film]


def _pose(one: TensorDictBase) -> Pose:
    return float(one["x_m"]), float(one["y_m"]), float(one["heading_rad"])


def _of_ball(env: FollowBall, one: TensorDictBase) -> Shot:
    world, angle_rad = env.world, float(one["ball_angle_rad"])
    radius_m = world.circle_radius_m
    return Shot(
        half_size_m=(radius_m + _MARGIN_M, radius_m + _MARGIN_M),
        walls=False,
        pose=_pose(one),
        # The robot has no size in this world, so the catch distance stands for its radius.
        radius_m=world.catch_distance_m,
        track_width_m=min(world.track_width_m, 1.7 * world.catch_distance_m),
        balls=[(radius_m * cos(angle_rad), radius_m * sin(angle_rad), 0.08, "ball")],
        view_rad=world.field_of_view_rad,
        bearing_rad=float(one["bearing"]),
    )


def _of_arena(env: Arena, one: TensorDictBase) -> Shot:
    world, pose = env.world, _pose(one)
    sonar, vision = world.sensors.sonar, world.sensors.vision
    walls, boxes, discs = env.obstacles(dict(one.items()))
    balls = [
        (float(one["ball_x_m"][0, i]), float(one["ball_y_m"][0, i]), ball.radius_m, ball.kind)
        for i, ball in enumerate(world.ball_entries)
    ]
    beams = []
    if sonar is not None:
        width_rad = radians(sonar.beam_width_deg)
        for i, (x_m, y_m, turn_deg) in enumerate(sonar.ring):
            reading_m = float(one["sonar_m"][0, i])
            direction_rad = pose[2] + radians(turn_deg)
            beams.append((*_ahead(pose, x_m, y_m), direction_rad, width_rad, reading_m))
    sees = vision is not None and "ball" in vision.kinds and bool(one["seen"])
    return Shot(
        half_size_m=(3.0, 3.0) if walls is None else (walls.half_width_m, walls.half_height_m),
        walls=walls is not None,
        pose=pose,
        radius_m=world.robot.radius_m,
        track_width_m=world.robot.track_width_m,
        balls=balls,
        discs=[] if discs is None else [*zip(*(v[:, 0].tolist() for v in discs), strict=True)],
        boxes=[] if boxes is None else _spots(boxes.corners()),
        beams=beams,
        view_rad=None if vision is None else vision.field_of_view_rad,
        bearing_rad=float(one["bearing"]) if sees else None,
    )


def _spots(corners: Point) -> list[list[Spot]]:
    """Return corners ``[boxes, 4, 1]`` as a list of points for each box."""
    return [
        [*zip(x.flatten().tolist(), y.flatten().tolist(), strict=True)]
        for x, y in zip(corners.x, corners.y, strict=True)
    ]


def _ahead(pose: Pose, forward_m: float, left_m: float) -> Spot:
    """Return the world coordinates of a point given relative to the robot."""
    x_m, y_m, heading_rad = pose
    return (
        x_m + forward_m * cos(heading_rad) - left_m * sin(heading_rad),
        y_m + forward_m * sin(heading_rad) + left_m * cos(heading_rad),
    )


class Canvas:
    """A figure of one or several panels that is reused for every frame.

    Args:
        panels: the number of panels.
        size_px: the width of a panel.
        titles: the panels' titles; none by default.
        columns: the number of columns; by default about the number of rows.
    """

    @own_style()
    def __init__(
        self,
        panels: int = 1,
        size_px: int = 360,
        titles: Sequence[str] = (),
        columns: int | None = None,
    ) -> None:
        columns = columns or ceil(sqrt(panels))
        rows = ceil(panels / columns)
        lines = 2 if titles else 1
        head = 16 * lines / size_px  # height of the title, as a share of a panel
        size_in = columns * size_px / _DPI, rows * (1 + head) * size_px / _DPI
        self._figure = Figure(figsize=size_in, dpi=_DPI)
        self._canvas = FigureCanvasAgg(self._figure)
        grid = [*self._figure.subplots(rows, columns, squeeze=False).flat]
        self._axes, self._titles = grid[:panels], [*titles] or [""] * panels
        for axes in grid[panels:]:
            axes.set_axis_off()
        self._figure.subplots_adjust(0.005, 0.005, 0.995, 1 - head / rows, 0.03, head + 0.02)

    @own_style()
    def draw(self, films: Sequence[Sequence[Shot]]) -> Image:
        """Return a picture of the last shot of each film, with trails from the earlier shots.

        Args:
            films: for each panel, at least one shot, in order of time.
        """
        for axes, title, film in zip(self._axes, self._titles, films, strict=True):
            draw(axes, film, title)
        canvas: Any = self._canvas  # Any, since its methods have no type annotations
        canvas.draw()
        image: Image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        return image


def draw(axes: Axes, film: Sequence[Shot], title: str = "") -> None:
    """Draw the last shot of a film, with trails from the earlier shots.

    Args:
        axes: the axes to draw on; they are cleared first.
        film: at least one shot, in order of time.
        title: the panel's title.
    """
    shot = film[-1]
    across_m, up_m = shot.half_size_m
    axes.clear()
    axes.set_aspect("equal")
    axes.set_xlim(-1.015 * across_m, 1.015 * across_m)
    axes.set_ylim(-1.015 * up_m, 1.015 * up_m)
    axes.set_xticks([])
    axes.set_yticks([])
    edge = "0.4" if not shot.ended else GOOD if shot.success else BAD
    for spine in axes.spines.values():
        spine.set_visible(not shot.walls)
        spine.set(color=edge if shot.ended else "0.85", linewidth=2.5 if shot.ended else 1)
    if shot.walls:
        field_ = Rectangle((-across_m, -up_m), 2 * across_m, 2 * up_m)
        _add(axes, field_, fill=False, edgecolor=edge, linewidth=2.5)
    _draw_senses(axes, shot)
    for x_m, y_m, radius_m in shot.discs:
        _add(axes, Circle((x_m, y_m), radius_m), facecolor=OBSTACLE, edgecolor="0.4")
    for corners in shot.boxes:
        _add(axes, Polygon(corners), facecolor=OBSTACLE, edgecolor="0.4")
    for number, (x_m, y_m, radius_m, kind) in enumerate(shot.balls):
        colour = BALL if kind == "ball" else OTHER_BALL
        way = [each.balls[number][:2] for each in film]
        axes.plot(*zip(*way, strict=True), ":", color=colour, lw=1.5)
        ball = Circle((x_m, y_m), radius_m)
        _add(axes, ball, facecolor=colour, edgecolor="0.25", linewidth=0.8, zorder=8)
    axes.plot(*zip(*(each.pose[:2] for each in film), strict=True), color=ROBOT, lw=1.2)
    _draw_robot(axes, shot)
    _draw_scale(axes, shot)
    words = f"step {shot.step}   reward {sum(each.reward for each in film):+.2f}"
    axes.set_title(f"{title}\n{words}" if title else words, fontsize=8, pad=3)


def _draw_senses(axes: Axes, shot: Shot) -> None:
    x_m, y_m, heading_rad = shot.pose
    if shot.view_rad is not None:
        left, right = (degrees(heading_rad + side * shot.view_rad) for side in (1, -1))
        view = Wedge((x_m, y_m), 20, right, left)
        _add(axes, view, facecolor=VIEW, edgecolor="none", alpha=0.7, zorder=0)
    for east_m, north_m, direction_rad, width_rad, reading_m in shot.beams:
        low, high = (degrees(direction_rad + side * width_rad / 2) for side in (-1, 1))
        cone = Wedge((east_m, north_m), reading_m, low, high)
        _add(axes, cone, facecolor=ECHO, edgecolor=ECHO, alpha=0.3, linewidth=0.8, zorder=1)
    if shot.bearing_rad is not None:
        end = _ahead((x_m, y_m, heading_rad + shot.bearing_rad), 20.0, 0.0)
        axes.plot([x_m, end[0]], [y_m, end[1]], "--", color=BALL, lw=0.8, zorder=1)


def _draw_robot(axes: Axes, shot: Shot) -> None:
    pose, radius_m = shot.pose, shot.radius_m
    body = Circle(pose[:2], radius_m)
    _add(axes, body, facecolor="white", edgecolor=ROBOT, linewidth=1.5, zorder=5)
    length_m, width_m = 0.9 * radius_m, 0.25 * radius_m
    for side in (1, -1):
        corner = _ahead(pose, -length_m / 2, side * shot.track_width_m / 2 - width_m / 2)
        wheel = Rectangle(corner, length_m, width_m, angle=degrees(pose[2]))
        _add(axes, wheel, facecolor="0.2", edgecolor="none", zorder=6)
    nose = _ahead(pose, radius_m, 0)
    axes.plot([pose[0], nose[0]], [pose[1], nose[1]], color=ROBOT, lw=2, zorder=7)


def _draw_scale(axes: Axes, shot: Shot) -> None:
    """Draw a bar of a round length, such as 1 m, in the lower left corner."""
    across_m, up_m = shot.half_size_m
    length_m = 10.0 ** floor(log10(across_m))
    left_m, low_m = -0.95 * across_m, -0.95 * up_m
    axes.plot([left_m, left_m + length_m], [low_m, low_m], color="0.35", lw=1.5, zorder=9)
    middle = (left_m + length_m / 2, low_m)
    axes.annotate(
        f"{length_m:g} m",
        middle,
        (0, 2),
        textcoords="offset points",
        fontsize=7,
        color="0.35",
        horizontalalignment="center",
        zorder=9,
    )


def _add(axes: Axes, patch: Patch, **looks: Any) -> None:
    patch.set(**looks)
    axes.add_patch(patch)
