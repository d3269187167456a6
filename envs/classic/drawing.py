"""Pictures of the classic worlds, as Gymnasium draws those that it has."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Any, ClassVar, Self

import numpy as np
from tensordict import TensorDictBase

from envs.classic.acrobot import Acrobot
from envs.classic.cart_pole import CartPole
from envs.classic.chain import Chain, right_action
from envs.classic.mountain_car import MountainCar
from envs.classic.random_walk import RandomWalk
from envs.shapes import DrawnShot, Look, Shape, Span, Spot

_GROUND = Look("ground", width_pt=1.5)
_BODY, _PIN = Look(fill="body"), Look("page", "dark", radius=0.09)


@dataclass(frozen=True)
class CarShot(DrawnShot):
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

    def limits(self) -> tuple[Span, Span]:
        low, high = self.road
        return (low - 0.12, high + 0.12), (-0.1, high - low + 0.14)

    def still(self) -> list[Shape]:
        low, high = self.road
        places = np.linspace(low - 0.12, high + 0.12, 100)
        road = [*zip(places.tolist(), _height(places).tolist(), strict=True)]
        foot, top = _height(self.goal), _height(self.goal) + 0.3
        flag = [(self.goal, top), (self.goal, top - 0.12), (self.goal - 0.14, top - 0.06)]
        wall = [(low - 0.1, _height(low)), (low - 0.1, _height(low) + 0.4)]
        return [
            Shape([(places[0], -0.1), *road, (places[-1], -0.1)], Look(fill="earth")),
            Shape(road, _GROUND),
            Shape(wall, Look("ground", width_pt=3)),
            Shape([(self.goal, foot), (self.goal, top)], Look("dark")),
            Shape(flag, Look(fill="flag")),
        ]

    def moving(self, film: Sequence[Self]) -> list[Shape]:
        positions = [each.position for each in film]
        farthest = [
            Shape([(place, _height(place) - 0.03), (place, _height(place) + 0.03)], Look("body"))
            for place in (min(positions), max(positions))
        ]
        slope_rad = atan2(3 * 0.45 * cos(3 * self.position), 1)
        along, up = (cos(slope_rad), sin(slope_rad)), (-sin(slope_rad), cos(slope_rad))

        def place(forward: float, above: float) -> Spot:
            return (
                self.position + forward * along[0] + above * up[0],
                _height(self.position) + forward * along[1] + above * up[1],
            )

        body = [place(*at) for at in ((-0.09, 0.03), (0.09, 0.03), (0.09, 0.11), (-0.09, 0.11))]
        wheel = Look("page", "dark", width_pt=0.5, radius=0.035)
        wheels = [Shape([place(forward, 0.035)], wheel) for forward in (-0.05, 0.05)]
        return [*farthest, Shape(body, _BODY), *wheels]


@dataclass(frozen=True)
class PoleShot(DrawnShot):
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

    def limits(self) -> tuple[Span, Span]:
        across = 1.1 * self.track_m
        return (-across, across), (0.5 - across, 0.5 + across)

    def still(self) -> list[Shape]:
        ends = [
            Shape([(end, -0.12), (end, 0.12)], _GROUND) for end in (-self.track_m, self.track_m)
        ]
        return [Shape([(-self.track_m, 0), (self.track_m, 0)], _GROUND), *ends]

    def moving(self, film: Sequence[Self]) -> list[Shape]:
        left, right = self.cart_m - 0.25, self.cart_m + 0.25
        return [
            self._pole(-self.largest_rad, Look("faint", dashed=True)),
            self._pole(self.largest_rad, Look("faint", dashed=True)),
            Shape([(left, -0.15), (right, -0.15), (right, 0.15), (left, 0.15)], _BODY),
            self._pole(self.pole_rad, Look("link", width_pt=4)),
        ]

    @classmethod
    def trail(cls, film: Sequence[Self]) -> Shape:
        return Shape([(each.cart_m, -0.3) for each in film], Look("body", width_pt=1.2))

    def _pole(self, angle_rad: float, look: Look) -> Shape:
        top = self.cart_m + self.pole_m * sin(angle_rad), 0.15 + self.pole_m * cos(angle_rad)
        return Shape([(self.cart_m, 0.15), top], look)


@dataclass(frozen=True)
class AcrobotShot(DrawnShot):
    """The two links, each of 1 m, and the bar 1 m above their pivot.

    Attributes:
        angle1_rad: the first link's angle; 0 points downwards.
        angle2_rad: the second link's angle, relative to the first.
    """

    angle1_rad: float
    angle2_rad: float

    trail_shots: ClassVar = 40

    @property
    def joint(self) -> Spot:
        """The place of the joint between the links."""
        return sin(self.angle1_rad), -cos(self.angle1_rad)

    @property
    def tip(self) -> Spot:
        """The place of the second link's free end."""
        x, y = self.joint
        both_rad = self.angle1_rad + self.angle2_rad
        return x + sin(both_rad), y - cos(both_rad)

    def limits(self) -> tuple[Span, Span]:
        return (-2.2, 2.2), (-2.2, 2.2)

    def still(self) -> list[Shape]:
        return [Shape([(-2.2, 1), (2.2, 1)], Look("flag", width_pt=1.5))]

    def moving(self, film: Sequence[Self]) -> list[Shape]:
        pivot = 0.0, 0.0
        return [
            Shape([pivot, self.joint], Look("body", width_pt=6)),
            Shape([self.joint, self.tip], Look("link", width_pt=6)),
            Shape([pivot], _PIN),
            Shape([self.joint], _PIN),
        ]

    @classmethod
    def trail(cls, film: Sequence[Self]) -> Shape:
        return Shape([each.tip for each in film], Look("link", width_pt=0.8))


@dataclass(frozen=True)
class RowShot(DrawnShot):
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

    def limits(self) -> tuple[Span, Span]:
        margin = 0.07 * self.states
        across = self._across
        return (-margin, self.states + 1 + margin), (-0.8 * across, 0.2 * across)

    def still(self) -> list[Shape]:
        last = self.states + 1
        ends = [(end, reward) for end, reward in zip((0, last), self.rewards, strict=True)]
        first = 1 if self.rewards[0] is None else 0
        shapes = [Shape([(first, 0), (last, 0)], Look("faint"))]
        for place in range(1, last):
            shapes.append(self._state(place, "page"))
        size = min(8.0, 150 / self.states)
        for place, sign in enumerate(self.signs, start=1):
            shapes.append(Shape([(place, 0.8)], Look("ground", width_pt=size, text=sign)))
        for end, reward in ends:
            if reward is not None:
                shapes.append(self._state(end, "faint"))
                words = Look("dark", width_pt=8, text=f"{reward:+g}", hangs=True)
                shapes.append(Shape([(end, -0.8)], words))
        return shapes

    def moving(self, film: Sequence[Self]) -> list[Shape]:
        return [self._state(self.place, "body")]

    @classmethod
    def trail(cls, film: Sequence[Self]) -> Shape:
        """Return the way so far: it runs downwards, from the first step below the row."""
        lowest = 0.5 - 0.8 * film[0]._across
        heights = np.linspace(-2, lowest, len(film)).tolist()
        places = [(each.place, height) for each, height in zip(film, heights, strict=True)]
        return Shape(places, Look("link"))

    @property
    def _across(self) -> float:
        return self.states + 1 + 0.14 * self.states

    def _state(self, place: int, fill: str) -> Shape:
        """Return a state's disc, or an end's square."""
        if 0 < place <= self.states:
            return Shape([(place, 0)], Look("ground", fill, radius=0.36))
        left, right = place - 0.36, place + 0.36
        corners = [(left, -0.36), (right, -0.36), (right, 0.36), (left, 0.36)]
        return Shape(corners, Look("ground", fill))


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
