"""The paths of balls: circle, line, still, waypoints. Every function is pure."""

import torch
from torch import Tensor

from envs.robot.draws import Draws
from envs.robot.geometry import Boxes, Point, Walls, rotated
from envs.robot.scene import CircleConfig, LineConfig, PathConfig, StillConfig, WaypointsConfig

MOTION = "x_m", "y_m", "east_mps", "north_mps", "along", "rate"
"""The state entries of a ball: its place; its velocity on a line; and its position along a circle
(rad) or waypoints (m) with the rate of change."""

Motion = dict[str, Tensor]


def start(path: PathConfig, draws: Draws) -> Motion:
    """Draw a ball's first place and its motion: the entries of `MOTION`, each ``[*batch]``."""
    nothing = draws.within(0.0)
    motion = dict.fromkeys(MOTION, nothing)
    match path:
        case CircleConfig():
            motion |= {"along": draws.within(path.angle_rad)}
            motion |= {"rate": draws.within(path.speed_radps)}
            place = on_circle(path, motion["along"])
        case WaypointsConfig():
            motion |= {"rate": draws.within(path.speed_mps)}
            place = between_waypoints(path, nothing)
        case StillConfig() | LineConfig():
            place = Point(draws.within(path.start_m[0]), draws.within(path.start_m[1]))
    if isinstance(path, LineConfig):
        direction_rad, speed_mps = draws.within(path.direction_rad), draws.within(path.speed_mps)
        motion |= {"east_mps": speed_mps * torch.cos(direction_rad)}
        motion |= {"north_mps": speed_mps * torch.sin(direction_rad)}
    return motion | {"x_m": place.x, "y_m": place.y}


def move(
    path: PathConfig,
    motion: Motion,
    time_step_s: float,
    radius_m: float,
    walls: Walls | None,
    boxes: Boxes | None,
) -> Motion:
    """Return a ball's motion after a time step.

    Args:
        path: the ball's path.
        motion: the entries of `MOTION`, ``[*batch]``.
        time_step_s: the length of the time step.
        radius_m: the ball's radius.
        walls, boxes: the obstacles that reflect a ball on a line; None for none.
    """
    if isinstance(path, StillConfig):
        return motion
    if isinstance(path, LineConfig):
        place, velocity = bounce(
            Point(motion["x_m"], motion["y_m"]),
            Point(motion["east_mps"], motion["north_mps"]),
            time_step_s,
            radius_m,
            walls,
            boxes,
        )
        motion = motion | {"east_mps": velocity.x, "north_mps": velocity.y}
    else:
        along = motion["along"] + motion["rate"] * time_step_s
        motion = motion | {"along": along}
        way = on_circle if isinstance(path, CircleConfig) else between_waypoints
        place = way(path, along)  # type: ignore[arg-type]  # the function for this type of path
    return motion | {"x_m": place.x, "y_m": place.y}


def on_circle(path: CircleConfig, angle_rad: Tensor) -> Point:
    """Return the point of a circle at an angle."""
    x_m, y_m = path.centre_m
    return Point(
        x_m + path.radius_m * torch.cos(angle_rad), y_m + path.radius_m * torch.sin(angle_rad)
    )


def between_waypoints(path: WaypointsConfig, along_m: Tensor) -> Point:
    """Return the point at a distance along the waypoints; an open path ends at its last point."""
    lengths = path.lengths_m
    left_m = along_m
    if path.closed:
        left_m = torch.remainder(left_m, sum(lengths))
    (x, y), *stops = path.stops_m
    place = Point(torch.full_like(along_m, x), torch.full_like(along_m, y))
    for (u, v), length in zip(stops, lengths, strict=True):
        share = (left_m / length).clamp(0, 1) if length > 0 else torch.zeros_like(left_m)
        place = Point(place.x + share * (u - x), place.y + share * (v - y))
        left_m = left_m - length
        x, y = u, v
    return place


def bounce(
    place: Point,
    velocity: Point,
    time_step_s: float,
    radius_m: float,
    walls: Walls | None,
    boxes: Boxes | None,
) -> tuple[Point, Point]:
    """Return a ball's place and velocity after a time step, with elastic bounces.

    At a box, the ball counts as a square with sides parallel to the box's. If several bounces in
    one step would still end inside a box, the ball keeps its place and reverses its velocity.

    Args:
        place, velocity: the place and velocity of the ball's centre, ``[*batch]``.
        time_step_s: the length of the time step.
        radius_m: the ball's radius.
        walls, boxes: the obstacles that reflect the ball; None for none.

    Returns:
        The new place and velocity. The speed doesn't change.
    """
    end = Point(place.x + velocity.x * time_step_s, place.y + velocity.y * time_step_s)
    after = velocity
    for box in range(0 if boxes is None else len(boxes.x_m)):
        end, after = _off_box(place, end, after, radius_m, _one(boxes, box))
    if walls is not None:
        x_m, turned_x = _folded(end.x, walls.half_width_m - radius_m)
        y_m, turned_y = _folded(end.y, walls.half_height_m - radius_m)
        end, after = Point(x_m, y_m), Point(after.x * turned_x, after.y * turned_y)
    stuck = torch.zeros_like(end.x, dtype=torch.bool)
    for box in range(0 if boxes is None else len(boxes.x_m)):
        stuck = stuck | _inside(end, radius_m, _one(boxes, box))
    return (
        Point(torch.where(stuck, place.x, end.x), torch.where(stuck, place.y, end.y)),
        Point(torch.where(stuck, -velocity.x, after.x), torch.where(stuck, -velocity.y, after.y)),
    )


def _folded(number: Tensor, half: float) -> tuple[Tensor, Tensor]:
    """Return a coordinate reflected into [−half, half], and the factor ±1 of its velocity."""
    phase = torch.remainder(number + half, 4 * half)
    back = phase > 2 * half
    return torch.where(back, 3 * half - phase, phase - half), 1.0 - 2.0 * back.to(number.dtype)


def _off_box(
    place: Point, end: Point, velocity: Point, radius_m: float, box: Boxes
) -> tuple[Point, Point]:
    """Return a step's end and the velocity there, reflected at the box side that the step meets."""
    cosine, sine = torch.cos(box.heading_rad), torch.sin(box.heading_rad)
    centre = box.centre
    here = rotated(Point(place.x - centre.x, place.y - centre.y), cosine, -sine)
    there = rotated(Point(end.x - centre.x, end.y - centre.y), cosine, -sine)
    speed = rotated(velocity, cosine, -sine)
    half_x, half_y = box.half_width_m + radius_m, box.half_height_m + radius_m
    way = Point(there.x - here.x, there.y - here.y)

    def meets(
        at: Tensor, to: Tensor, other: Tensor, way: Tensor, half: Tensor, half_other: Tensor
    ) -> Tensor:
        share = (at.abs() - half) / (at - to).abs()
        towards = (at.abs() >= half) & (at * to < at * at) & (share <= 1)
        return towards & ((other + share * way).abs() <= half_other)

    on_x = meets(here.x, there.x, here.y, way.y, half_x, half_y)
    on_y = meets(here.y, there.y, here.x, way.x, half_y, half_x) & ~on_x
    side_x = torch.where(here.x > 0, half_x, -half_x)
    side_y = torch.where(here.y > 0, half_y, -half_y)
    mirrored = Point(
        torch.where(on_x, 2 * side_x - there.x, there.x),
        torch.where(on_y, 2 * side_y - there.y, there.y),
    )
    thrown = Point(torch.where(on_x, -speed.x, speed.x), torch.where(on_y, -speed.y, speed.y))
    back = rotated(mirrored, cosine, sine)
    hit = on_x | on_y
    new_velocity = rotated(thrown, cosine, sine)
    return (
        Point(
            torch.where(hit, back.x + centre.x, end.x), torch.where(hit, back.y + centre.y, end.y)
        ),
        Point(
            torch.where(hit, new_velocity.x, velocity.x),
            torch.where(hit, new_velocity.y, velocity.y),
        ),
    )


def _inside(point: Point, radius_m: float, box: Boxes) -> Tensor:
    at = box.in_frame(point)
    return (at.x.abs() < box.half_width_m + radius_m) & (at.y.abs() < box.half_height_m + radius_m)


def _one(boxes: Boxes | None, number: int) -> Boxes:
    """Return the box with a number, each entry ``[*batch]``."""
    assert boxes is not None
    return Boxes(*(values[number] for values in boxes))
