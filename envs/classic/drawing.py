"""Pictures of the classic worlds, as Gymnasium draws those that it has."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, degrees, sin
from typing import Any, Self

import numpy as np
from tensordict import TensorDictBase

from envs.canvas import Shot, add, write_title
from envs.classic.acrobot import Acrobot
from envs.classic.cart_pole import CartPole
from envs.classic.chain import Chain, right_action
from envs.classic.mountain_car import MountainCar
from envs.classic.random_walk import RandomWalk
from envs.pictures import Axes, Circle, Polygon, Rectangle

BODY, LINK, FLAG, GROUND = "#0072B2", "#E69F00", "#009E73", "0.4"

Span = tuple[float, float]


@dataclass(frozen=True)
class CarShot(Shot):
    """The car in its valley.

    Attributes:
        position, velocity: the car's.
        road: the lowest and the highest position.
        goal: the position of the flag.
    """

    position: float
    velocity: float
    road: Span
    goal: float

    def draw(self, axes: Axes, film: Sequence[Self], title: str = "") -> None:
        low, high = self.road
        _scene(axes, self, (low - 0.12, high + 0.12), (-0.1, high - low + 0.14))
        axes.plot([low - 0.1] * 2, [_height(low), _height(low) + 0.4], color=GROUND, lw=3)  # a wall
        places = np.linspace(low - 0.12, high + 0.12, 200)
        axes.plot(places, _height(places), color=GROUND, lw=1.5)
        axes.fill_between(places, -0.1, _height(places), color="0.92")
        farthest = max(each.position for each in film), min(each.position for each in film)
        for place in farthest:
            axes.plot(place, _height(place), "|", color=BODY, ms=9, mew=1.5)
        axes.plot(
            [self.goal] * 2, [_height(self.goal), _height(self.goal) + 0.3], color="0.2", lw=1
        )
        top = _height(self.goal) + 0.3
        flag = [(self.goal, top), (self.goal, top - 0.12), (self.goal - 0.14, top - 0.06)]
        add(axes, Polygon(flag), facecolor=FLAG, edgecolor="none")
        self._draw_car(axes)
        write_title(axes, film, title)

    def _draw_car(self, axes: Axes) -> None:
        slope_rad = atan2(3 * 0.45 * cos(3 * self.position), 1)
        along, up = (cos(slope_rad), sin(slope_rad)), (-sin(slope_rad), cos(slope_rad))

        def place(forward: float, above: float) -> Span:
            return (
                self.position + forward * along[0] + above * up[0],
                _height(self.position) + forward * along[1] + above * up[1],
            )

        body = Rectangle(place(-0.09, 0.03), 0.18, 0.08, angle=degrees(slope_rad))
        add(axes, body, facecolor=BODY, edgecolor="none", zorder=5)
        for forward in (-0.05, 0.05):
            wheel = Circle(place(forward, 0.035), 0.035)
            add(axes, wheel, facecolor="0.2", edgecolor="white", linewidth=0.5, zorder=6)


@dataclass(frozen=True)
class PoleShot(Shot):
    """The pole on its cart.

    Attributes:
        cart_m: the cart's place.
        pole_rad: the pole's angle; positive is to the right.
        track_m: the cart leaves the track at ± this.
        largest_rad: the pole has fallen beyond ± this.
        pole_m: the pole's length.
    """

    cart_m: float
    pole_rad: float
    track_m: float
    largest_rad: float
    pole_m: float

    def draw(self, axes: Axes, film: Sequence[Self], title: str = "") -> None:
        across = 1.1 * self.track_m
        _scene(axes, self, (-across, across), (0.5 - across, 0.5 + across))
        axes.plot([-self.track_m, self.track_m], [0, 0], color=GROUND, lw=1.5)
        for end in (-self.track_m, self.track_m):
            axes.plot([end, end], [-0.12, 0.12], color=GROUND, lw=1.5)
        for side in (-1, 1):
            self._draw_pole(axes, side * self.largest_rad, color="0.75", lw=1, ls="--")
        axes.plot([each.cart_m for each in film], [-0.3] * len(film), color=BODY, lw=1.2)
        cart = Rectangle((self.cart_m - 0.25, -0.15), 0.5, 0.3)
        add(axes, cart, facecolor=BODY, edgecolor="none", zorder=5)
        self._draw_pole(axes, self.pole_rad, color=LINK, lw=4, zorder=6)
        write_title(axes, film, title)

    def _draw_pole(self, axes: Axes, angle_rad: float, **looks: Any) -> None:
        top = self.cart_m + self.pole_m * sin(angle_rad), 0.15 + self.pole_m * cos(angle_rad)
        axes.plot([self.cart_m, top[0]], [0.15, top[1]], **looks)


@dataclass(frozen=True)
class AcrobotShot(Shot):
    """The two links, each of 1 m, and the bar 1 m above their pivot.

    Attributes:
        angle1_rad: the first link's angle; 0 points downwards.
        angle2_rad: the second link's angle, relative to the first.
    """

    angle1_rad: float
    angle2_rad: float

    @property
    def joint(self) -> Span:
        """The place of the joint between the links."""
        return sin(self.angle1_rad), -cos(self.angle1_rad)

    @property
    def tip(self) -> Span:
        """The place of the second link's free end."""
        x, y = self.joint
        both_rad = self.angle1_rad + self.angle2_rad
        return x + sin(both_rad), y - cos(both_rad)

    def draw(self, axes: Axes, film: Sequence[Self], title: str = "") -> None:
        _scene(axes, self, (-2.2, 2.2), (-2.2, 2.2))
        axes.plot([-2.2, 2.2], [1, 1], color=FLAG, lw=1.5)
        axes.plot(*zip(*(each.tip for each in film[-40:]), strict=True), color=LINK, lw=0.8)
        places = (0.0, 0.0), self.joint, self.tip
        axes.plot(*zip(*places[:2], strict=True), color=BODY, lw=6, solid_capstyle="round")
        axes.plot(*zip(*places[1:], strict=True), color=LINK, lw=6, solid_capstyle="round")
        for place in places[:2]:
            add(axes, Circle(place, 0.09), facecolor="0.2", edgecolor="white", zorder=6)
        write_title(axes, film, title)


@dataclass(frozen=True)
class RowShot(Shot):
    """A row of states, with an end to the right and perhaps another to the left.

    Attributes:
        place: the present state, from 1 to the number of states, or an end beyond them.
        states: the number of states.
        rewards: the reward of the left end, None if there is no such end, and of the right end.
        signs: a sign for each state; none by default.
    """

    place: int
    states: int
    rewards: tuple[float | None, float]
    signs: str = ""

    def draw(self, axes: Axes, film: Sequence[Self], title: str = "") -> None:
        margin = 0.07 * self.states
        across = self.states + 1 + 2 * margin
        _scene(axes, self, (-margin, self.states + 1 + margin), (-0.8 * across, 0.2 * across))
        ends = [*(() if self.rewards[0] is None else (0,)), self.states + 1]
        axes.plot([min(ends, default=1), self.states + 1], [0, 0], color="0.75", lw=1, zorder=0)
        for place in range(1, self.states + 1):
            here = place == self.place
            circle = Circle((place, 0), 0.36)
            add(axes, circle, facecolor=BODY if here else "white", edgecolor=GROUND, zorder=2)
        size = min(8.0, 150 / self.states)
        for place, sign in enumerate(self.signs, start=1):
            axes.text(place, 0.8, sign, fontsize=size, ha="center", va="bottom", color="0.4")
        for end, reward in zip((0, self.states + 1), self.rewards, strict=True):
            if reward is not None:
                square = Rectangle((end - 0.36, -0.36), 0.72, 0.72)
                looks = {"facecolor": BODY if end == self.place else "0.85", "edgecolor": GROUND}
                add(axes, square, **looks, zorder=2)
                axes.text(end, -0.8, f"{reward:+g}", fontsize=8, ha="center", va="top")
        # The way so far runs downwards, from the first step below the row to the present one.
        steps = np.linspace(-2, 0.5 - 0.8 * across, len(film)) if len(film) > 1 else [-2]
        axes.plot([each.place for each in film], steps, color=LINK, lw=1)
        write_title(axes, film, title)


def of_car(env: MountainCar, one: TensorDictBase) -> CarShot:
    """Return the shot of a single run of Mountain Car."""
    world = env.world
    return CarShot(
        position=float(one["position"]),
        velocity=float(one["velocity"]),
        road=(world.lowest_position, world.highest_position),
        goal=world.goal_position,
    )


def of_pole(env: CartPole, one: TensorDictBase) -> PoleShot:
    """Return the shot of a single run of Cart-Pole."""
    world = env.world
    return PoleShot(
        cart_m=float(one["cart_m"]),
        pole_rad=float(one["pole_rad"]),
        track_m=world.track_m,
        largest_rad=world.largest_angle_rad,
        pole_m=2 * world.half_pole_m,
    )


def of_acrobot(env: Acrobot, one: TensorDictBase) -> AcrobotShot:
    """Return the shot of a single run of Acrobot."""
    return AcrobotShot(angle1_rad=float(one["angle1_rad"]), angle2_rad=float(one["angle2_rad"]))


def of_walk(env: RandomWalk, one: TensorDictBase) -> RowShot:
    """Return the shot of a single run of the random walk."""
    world = env.world
    return RowShot(
        place=int(one["place"]),
        states=world.states,
        rewards=(world.left_reward, world.right_reward),
    )


def of_chain(env: Chain, one: TensorDictBase) -> RowShot:
    """Return the shot of a single run of the chain, with the right action above each state."""
    world = env.world
    places = one["place"].new_tensor(range(1, world.length + 1))
    rights = right_action(places, world.choices).int().tolist()
    return RowShot(
        place=int(one["place"]),
        states=world.length,
        rewards=(None, world.goal_reward),
        signs="".join(f"{right:x}"[-1] for right in rights),
    )


def _height(position: Any) -> Any:
    """Return the height of Mountain Car's road at places, as in Gymnasium's picture."""
    return np.sin(3 * position) * 0.45 + 0.55


def _scene(axes: Axes, shot: Shot, x: Span, y: Span) -> None:
    """Clear the axes and set their limits and the frame."""
    axes.clear()
    axes.set_aspect("equal")
    axes.set_xlim(*x)
    axes.set_ylim(*y)
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set(color=shot.edge if shot.ended else "0.85", linewidth=2.5 if shot.ended else 1)
