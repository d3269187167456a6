"""The parameters of a scene: field, robot, obstacles, balls and sensors. No torch.

Lengths are in metres. x points east and y north; angles are anticlockwise from x. Instead of a
number, some parameters accept a range [least, greatest]: each situation draws a number from it.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise
from math import cos, floor, hypot, inf, pi, sin
from typing import Any, ClassVar

from envs.core.parameters import (
    OutOfRange,
    Parameters,
    flag,
    made_from,
    mappings,
    matching,
    number,
    number_or_range,
    one_of,
    or_null,
    place,
    point,
    rising_pair,
    rows,
    texts,
    whole,
    wholes,
)
from envs.core.world import Range, WorldConfig

MOST_SENSORS = 64
"""The largest number of sonars for which a step has enough random numbers."""


def span(value: Any) -> Range:
    """Return the least and the greatest value of a number or of a range."""
    return (value[0], value[1]) if isinstance(value, list) else (value, value)


# -- robot ----------------------------------------------------------------------------------------


@dataclass
class RobotConfig(Parameters):
    """A disc-shaped robot with two driven wheels that starts at the origin."""

    speed_mps: float = number(above=0)
    track_width_m: float = number(above=0)
    radius_m: float = number(above=0)
    heading_rad: Any = number_or_range()
    collision: str = one_of("stop", "end")


# -- obstacles ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DiscConfig(Parameters):
    """A group of ``number`` round obstacles."""

    shape: str = one_of("disc", "box")
    number: int = whole(1)
    centre_m: list[Any] = place()
    radius_m: Any = number_or_range(above=0)

    @property
    def reach_m(self) -> float:
        """The greatest possible radius."""
        return span(self.radius_m)[1]

    @property
    def drawn(self) -> bool:
        """True if the place or the radius is drawn at random."""
        return any(isinstance(value, list) for value in (*self.centre_m, self.radius_m))


@dataclass(frozen=True)
class BoxConfig(Parameters):
    """A group of ``number`` rectangular obstacles. Their width is along the heading."""

    shape: str = one_of("disc", "box")
    number: int = whole(1)
    centre_m: list[Any] = place()
    size_m: list[float] = point("width", "height", above=0)
    heading_rad: Any = number_or_range()

    @property
    def reach_m(self) -> float:
        """The distance from the centre to a corner."""
        return hypot(*self.size_m) / 2

    @property
    def drawn(self) -> bool:
        """True if the place or the heading is drawn at random."""
        return any(isinstance(value, list) for value in (*self.centre_m, self.heading_rad))


ObstacleConfig = DiscConfig | BoxConfig
OBSTACLES: dict[str, type[ObstacleConfig]] = {"disc": DiscConfig, "box": BoxConfig}


# -- balls ----------------------------------------------------------------------------------------

_PATHS = "circle", "line", "still", "waypoints"


@dataclass(frozen=True)
class CircleConfig(Parameters):
    """A circular path at constant angular speed."""

    path: str = one_of(*_PATHS)
    centre_m: list[float] = point("x", "y")
    radius_m: float = number(above=0)
    angle_rad: Any = number_or_range()
    speed_radps: Any = number_or_range()


@dataclass(frozen=True)
class LineConfig(Parameters):
    """A straight path with elastic bounces off walls and boxes."""

    path: str = one_of(*_PATHS)
    start_m: list[Any] = place()
    direction_rad: Any = number_or_range()
    speed_mps: Any = number_or_range(0)


@dataclass(frozen=True)
class StillConfig(Parameters):
    """The path of a ball that lies still."""

    path: str = one_of(*_PATHS)
    start_m: list[Any] = place()


@dataclass(frozen=True)
class WaypointsConfig(Parameters):
    """A path from point to point: an endless loop if closed, otherwise up to the last point."""

    path: str = one_of(*_PATHS)
    points_m: list[list[float]] = rows("x", "y", least=2)
    speed_mps: Any = number_or_range(0)
    closed: bool = flag()

    @property
    def stops_m(self) -> list[list[float]]:
        """The points in order; if the path is closed, the first point is repeated at the end."""
        return [*self.points_m, *self.points_m[:1]] if self.closed else self.points_m

    @property
    def lengths_m(self) -> list[float]:
        """The distances between successive points."""
        return [hypot(x - u, y - v) for (u, v), (x, y) in pairwise(self.stops_m)]


PathConfig = CircleConfig | LineConfig | StillConfig | WaypointsConfig
PATHS: dict[str, type[PathConfig]] = {
    "circle": CircleConfig,
    "line": LineConfig,
    "still": StillConfig,
    "waypoints": WaypointsConfig,
}


@dataclass(frozen=True)
class BallConfig(Parameters):
    """A ball. Each situation draws one of its paths with equal probability."""

    kind: str = matching(r"[a-z][a-z0-9_]*", "a word in small letters")
    radius_m: float = number(above=0)
    paths: list[Any] = mappings()

    @cached_property
    def routes(self) -> list[PathConfig]:
        """The parsed entries of ``paths``."""
        return [_entry(PATHS, "path", path, f"paths[{i}]") for i, path in enumerate(self.paths)]


# -- sensors --------------------------------------------------------------------------------------


@dataclass
class SonarConfig(Parameters):
    """A ring of sonars. Each observation is the least reading in a group of sonars."""

    ring: list[Any] = rows("x_m", "y_m", "heading_deg")
    groups: dict[str, list[int]] = wholes(0)
    beam_width_deg: float = number(above=0, high=175)
    max_incidence_deg: float | None = or_null(number(above=0, high=89))
    range_m: list[float] = rising_pair("least", "greatest")
    noise_m: float = number(0)
    noise_share: float = number(0)
    dropout: float = number(0, 1)
    sees_balls: bool = flag()

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield an error for too many sonars, groups of unknown sonars and negative ranges."""
        if len(self.ring) > MOST_SENSORS:
            yield OutOfRange("ring", self.ring, f"at most {MOST_SENSORS} sonars")
        for name, members in self.groups.items():
            if max(members) >= len(self.ring):
                allowed = f"numbers of sonars, 0 to {len(self.ring) - 1}"
                yield OutOfRange(f"groups.{name}", members, allowed)
        if self.range_m[0] < 0:
            yield OutOfRange("range_m", self.range_m, "a pair [least, greatest] of numbers >= 0")


@dataclass
class VisionConfig(Parameters):
    """A camera head that sees the balls of the given kinds."""

    kinds: list[str] = texts(most=32)
    field_of_view_rad: float = number(above=0, high=pi)  # to either side
    range_m: float = number(above=0)
    resolution_rad: float = number(0)
    bearing_noise_rad: float = number(0)
    distance_noise_share: float = number(0)
    miss_probability: float = number(0, 1)
    unseen: str = one_of("saturate", "hold", "lost")


@dataclass
class SensorsConfig(Parameters):
    """The robot's sensors; None for a sensor that it doesn't have."""

    sonar: SonarConfig | None
    vision: VisionConfig | None


# -- all of it ------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class SceneConfig(WorldConfig):
    """The parameters that all :class:`envs.robot.arena.Arena` tasks share."""

    time_step_s: float = number(above=0)
    field_size_m: list[float] | None = or_null(point("width", "height", above=0))
    clearance_m: float = number(0)

    robot: RobotConfig
    obstacles: list[Any] = mappings()
    balls: list[Any] = mappings()
    sensors: SensorsConfig

    action_name: ClassVar = "steer"  # Δv: 1 turns right

    @cached_property
    def obstacle_entries(self) -> list[ObstacleConfig]:
        """The parsed entries of ``obstacles``."""
        return [
            _entry(OBSTACLES, "shape", values, f"obstacles[{i}]")
            for i, values in enumerate(self.obstacles)
        ]

    @cached_property
    def ball_entries(self) -> list[BallConfig]:
        """The parsed entries of ``balls``."""
        return [made_from(BallConfig, values, f"balls[{i}]") for i, values in enumerate(self.balls)]

    @property
    def observations(self) -> Mapping[str, Range]:
        """Ranges of each ball kind's bearing, distance and visibility, and of each sonar group."""
        seen: dict[str, Range] = {}
        if (vision := self.sensors.vision) is not None:
            for kind in vision.kinds:
                bearing, distance_m, found = names_of(kind)
                seen[bearing] = (-vision.field_of_view_rad, vision.field_of_view_rad)
                seen[distance_m] = (0.0, vision.range_m)
                seen[found] = (0.0, 1.0)
        if (sonar := self.sensors.sonar) is not None:
            seen |= dict.fromkeys(sonar.groups, (sonar.range_m[0], sonar.range_m[1]))
        return seen

    @property
    def actions(self) -> Range:
        """The range of Δv, the wheels' relative speed."""
        return -1.0, 1.0

    @property
    def stride_m(self) -> float:
        """The distance that the robot drives in a step."""
        return self.robot.speed_mps * self.time_step_s

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield an error for each parameter with which the scene is impossible."""
        try:
            obstacles, balls = self.obstacle_entries, self.ball_entries
            for i, ball in enumerate(balls):
                if not ball.paths:
                    yield OutOfRange(f"balls[{i}].paths", [], "a list of at least one path")
                _prefixed(f"balls[{i}].", lambda ball=ball: ball.routes)
        except OutOfRange as wrong:
            yield wrong
            return
        yield from self._outside(obstacles, balls)
        yield from self._overlaps(obstacles, balls)
        yield from self._unknown_kinds(balls)

    def way_to_obstacles_m(self) -> float:
        """Return the least distance that the robot drives before it can touch anything."""
        ways = [inf]
        if self.field_size_m is not None:
            ways.append(min(self.field_size_m) / 2)
        for each in self.obstacle_entries:
            if each.drawn:
                ways.append(self.robot.radius_m + self.clearance_m)
            else:
                ways.append(_gap_to_disc(each, (0.0, 0.0), 0.0))
        return min(ways) - self.robot.radius_m

    def way_to_ball_m(self) -> float:
        """Return the least distance that the robot drives before it can meet kind ``ball``."""
        ways = [inf]
        for ball in self.ball_entries:
            for path in ball.routes if ball.kind == "ball" else ():
                speed_mps = 0.0
                match path:
                    case CircleConfig():
                        away_m = abs(path.radius_m - hypot(*path.centre_m))
                    case WaypointsConfig():
                        away_m = 0.0
                    case LineConfig() | StillConfig():
                        nearest = [
                            min(max(0.0, low), high) for low, high in map(span, path.start_m)
                        ]
                        away_m = hypot(*nearest)
                if isinstance(path, LineConfig):
                    speed_mps = span(path.speed_mps)[1]
                ways.append(away_m * self.robot.speed_mps / (self.robot.speed_mps + speed_mps))
        return min(ways)

    def _outside(
        self, obstacles: list[ObstacleConfig], balls: list[BallConfig]
    ) -> Iterator[OutOfRange]:
        """Yield an error for each obstacle or ball path that leaves the field."""
        if self.field_size_m is None:
            return
        width_m, height_m = self.field_size_m
        if min(width_m, height_m) <= 2 * self.robot.radius_m:
            allowed = f"wider and higher than the robot, 2 · radius_m = {2 * self.robot.radius_m:g}"
            yield OutOfRange("field_size_m", self.field_size_m, allowed)
        within = f"within the field of {width_m:g} m x {height_m:g} m"

        def out(place: Any, margin_m: float = 0) -> bool:
            return any(
                max(map(abs, span(value))) > size_m / 2 - margin_m
                for value, size_m in zip(place, self.field_size_m or (), strict=True)
            )

        for i, obstacle in enumerate(obstacles):
            if out(obstacle.centre_m):
                yield OutOfRange(f"obstacles[{i}].centre_m", obstacle.centre_m, within)
        for i, ball in enumerate(balls):
            for j, path in enumerate(ball.routes):
                key = f"balls[{i}].paths[{j}]"
                if isinstance(path, CircleConfig) and out(path.centre_m, path.radius_m):
                    yield OutOfRange(f"{key}.radius_m", path.radius_m, f"a circle {within}")
                if isinstance(path, LineConfig | StillConfig) and out(path.start_m, ball.radius_m):
                    yield OutOfRange(f"{key}.start_m", path.start_m, f"with the ball {within}")
                if isinstance(path, WaypointsConfig) and any(map(out, path.points_m)):
                    yield OutOfRange(f"{key}.points_m", path.points_m, within)

    def _overlaps(
        self, obstacles: list[ObstacleConfig], balls: list[BallConfig]
    ) -> Iterator[OutOfRange]:
        """Yield errors for overlaps of fixed obstacles and for drawn obstacles without room."""
        fixed = {i: each for i, each in enumerate(obstacles) if not each.drawn}
        for i, each in fixed.items():
            key = f"obstacles[{i}]"
            if each.number > 1:
                yield OutOfRange(
                    f"{key}.number",
                    each.number,
                    "1 unless its centre, radius or heading is a range",
                )
            if _gap_to_disc(each, (0.0, 0.0), self.robot.radius_m) <= 0:
                yield OutOfRange(f"{key}.centre_m", each.centre_m, "clear of the robot's start")
            for j, ball in enumerate(balls):
                for path in ball.routes:
                    if isinstance(path, LineConfig | StillConfig) and _reaches(
                        each, path.start_m, ball.radius_m
                    ):
                        allowed = f"clear of where balls[{j}] starts"
                        yield OutOfRange(f"{key}.centre_m", each.centre_m, allowed)
        for (i, one), (j, other) in combinations(fixed.items(), 2):
            if _overlap(one, other):
                allowed = f"clear of obstacles[{i}]"
                yield OutOfRange(f"obstacles[{j}].centre_m", other.centre_m, allowed)
        yield from self._without_room(obstacles)

    def _without_room(self, obstacles: list[ObstacleConfig]) -> Iterator[OutOfRange]:
        """Yield an error if placing drawn obstacles at the first free grid points fails."""
        gap_m = self.clearance_m
        taken = [(0.0, 0.0, self.robot.radius_m)]
        for each in obstacles:
            if not each.drawn:
                x_m, y_m = each.centre_m
                taken.append((x_m, y_m, each.reach_m))
        for i, each in enumerate(obstacles):
            if not each.drawn:
                continue
            points = [(x, y) for x in _grid(each.centre_m[0]) for y in _grid(each.centre_m[1])]
            for _ in range(each.number):
                free = next(
                    (
                        (x, y)
                        for x, y in points
                        if all(
                            hypot(x - u, y - v) > each.reach_m + reach_m + gap_m
                            for u, v, reach_m in taken
                        )
                    ),
                    None,
                )
                if free is None:
                    allowed = (
                        f"a region with room for {each.number} obstacles of {each.reach_m:g} m "
                        f"with clearance_m={gap_m:g} between them and round the robot"
                    )
                    yield OutOfRange(f"obstacles[{i}].centre_m", each.centre_m, allowed)
                    return
                taken.append((*free, each.reach_m))

    def _unknown_kinds(self, balls: list[BallConfig]) -> Iterator[OutOfRange]:
        """Yield an error for each kind without a ball and each sonar group with a taken name."""
        vision, sonar = self.sensors.vision, self.sensors.sonar
        kinds = {ball.kind for ball in balls}
        for kind in () if vision is None else vision.kinds:
            if kind not in kinds:
                allowed = f"kinds of balls in the scene: {', '.join(sorted(kinds)) or 'none'}"
                yield OutOfRange("sensors.vision.kinds", kind, allowed)
        taken = {name for kind in kinds for name in names_of(kind)} | {"chance", "action", "reward"}
        for name, members in () if sonar is None else sonar.groups.items():
            if name in taken:
                yield OutOfRange(
                    f"sensors.sonar.groups.{name}", members, "a group with an unused name"
                )


def names_of(kind: str) -> tuple[str, str, str]:
    """Return the names of a ball kind's observations: bearing, distance and visibility."""
    prefix = "" if kind == "ball" else f"{kind}_"
    return f"{prefix}bearing", f"{kind}_distance_m", f"{prefix}seen"


def _entry(schemas: Mapping[str, type[Any]], which: str, values: Any, key: str) -> Any:
    """Parse an entry by the schema that its key ``which`` names."""
    kind = values.get(which, "???")
    if kind not in schemas:
        raise OutOfRange(f"{key}.{which}", kind, " or ".join(schemas))
    return made_from(schemas[kind], values, key)


def _prefixed(prefix: str, read: Any) -> None:
    """Call ``read``, and put a prefix before the key of an OutOfRange error that it raises."""
    try:
        read()
    except OutOfRange as wrong:
        raise OutOfRange(prefix + wrong.key, wrong.value, wrong.allowed) from wrong


def _grid(value: Any, points: int = 21) -> list[float]:
    low, high = span(value)
    return [low + (high - low) * i / (points - 1) for i in range(points if high > low else 1)]


# -- gaps between fixed obstacles -----------------------------------------------------------------


def _gap_to_disc(obstacle: ObstacleConfig, centre_m: tuple[float, float], radius_m: float) -> float:
    """Return the gap between a fixed obstacle and a disc; negative if they overlap."""
    x_m, y_m = centre_m[0] - obstacle.centre_m[0], centre_m[1] - obstacle.centre_m[1]
    if isinstance(obstacle, DiscConfig):
        return float(hypot(x_m, y_m) - obstacle.radius_m - radius_m)
    cosine, sine = cos(obstacle.heading_rad), sin(obstacle.heading_rad)
    across = abs(cosine * x_m + sine * y_m) - obstacle.size_m[0] / 2
    up = abs(cosine * y_m - sine * x_m) - obstacle.size_m[1] / 2
    outside_m = hypot(max(across, 0), max(up, 0))
    return (outside_m or max(across, up)) - radius_m


def _reaches(obstacle: ObstacleConfig, place: Any, radius_m: float) -> bool:
    """Return whether a ball that starts in a place or region can overlap a fixed obstacle."""
    spans = [*map(span, place)]
    centre_m = [(low + high) / 2 for low, high in spans]
    region = BoxConfig("box", 1, centre_m, [high - low for low, high in spans], 0.0)
    if isinstance(obstacle, DiscConfig):
        x_m, y_m = obstacle.centre_m
        return _gap_to_disc(region, (x_m, y_m), obstacle.radius_m + radius_m) < 0
    # Two rectangles that don't overlap are nearest to each other at a corner of one of them.
    return _overlap(region, obstacle) or any(
        _gap_to_disc(one, corner, radius_m) < 0
        for one, other in ((region, obstacle), (obstacle, region))
        for corner in _corners(other)
    )


def _corners(box: BoxConfig) -> list[tuple[float, float]]:
    """Return the corners of a fixed box, x and y in m."""
    cosine, sine = cos(box.heading_rad), sin(box.heading_rad)
    along, across = (size / 2 for size in box.size_m)
    return [
        (
            box.centre_m[0] + cosine * forward - sine * left,
            box.centre_m[1] + sine * forward + cosine * left,
        )
        for forward in (along, -along)
        for left in (across, -across)
    ]


def _overlap(one: ObstacleConfig, other: ObstacleConfig) -> bool:
    """Return whether two fixed obstacles overlap."""
    if isinstance(other, DiscConfig):
        return _gap_to_disc(one, (other.centre_m[0], other.centre_m[1]), other.radius_m) < 0
    if isinstance(one, DiscConfig):
        return _overlap(other, one)
    # Two rectangles are disjoint if their projections onto some side's direction are.
    axes = [box.heading_rad + turn for box in (one, other) for turn in (0.0, pi / 2)]
    return all(_shadows_meet(one, other, axis) for axis in axes)


def _shadows_meet(one: BoxConfig, other: BoxConfig, axis_rad: float) -> bool:
    along = cos(axis_rad), sin(axis_rad)
    apart = abs(
        sum(
            (mine - its) * part
            for mine, its, part in zip(one.centre_m, other.centre_m, along, strict=True)
        )
    )
    reach = 0.0
    for box in (one, other):
        turn = axis_rad - box.heading_rad
        reach += (box.size_m[0] * abs(cos(turn)) + box.size_m[1] * abs(sin(turn))) / 2
    return bool(apart < reach)


def steps_for(way_m: float, stride_m: float) -> int:
    """Return a lower bound, at least 1, of the number of steps that a distance takes."""
    return max(1, floor(way_m / stride_m)) if way_m < inf else 2**31
