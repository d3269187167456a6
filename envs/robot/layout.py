"""The placement of obstacles in a situation: fixed obstacles, and obstacles drawn at random."""

import torch
from torch import Tensor

from envs.robot.draws import Draws
from envs.robot.geometry import Boxes, Discs, Point, between, square
from envs.robot.scene import BoxConfig, DiscConfig, ObstacleConfig, span

DRAWN = {
    "disc": ("disc_x_m", "disc_y_m", "disc_radius_m"),
    "box": ("box_x_m", "box_y_m", "box_heading_rad"),
}
"""The state entries of randomly drawn obstacles, by shape."""

TRIES = 12
"""The number of places tried for an obstacle. If none has room, the obstacle is left out."""

NOWHERE_M = 1e4
"""The coordinates of an obstacle that is left out: far beyond every sensor's range."""


def draw_obstacles(
    obstacles: list[ObstacleConfig],
    draws: Draws,
    keep_clear: list[tuple[Point, float]],
    clearance_m: float,
) -> dict[str, Tensor]:
    """Draw the obstacles that aren't fixed, one after the other.

    Each new obstacle keeps clear of all others, fixed obstacles included. For this test every
    obstacle counts as a disc that encloses it.

    Args:
        obstacles: the scene's obstacles.
        draws: the random numbers of the situation.
        keep_clear: centres ``[*batch]`` and radii of further discs to keep clear of.
        clearance_m: the least gap.

    Returns:
        The entries of `DRAWN` for each shape with drawn obstacles, ``[discs, *batch]`` or
        ``[boxes, *batch]``.
    """
    taken: list[tuple[Point, Tensor | float]] = [*keep_clear]
    for each in obstacles:
        if not each.drawn:
            place = Point(*(draws.within(value) for value in each.centre_m))
            taken.append((place, each.reach_m))
    drawn: dict[str, list[Tensor]] = {}
    for each in obstacles:
        if not each.drawn:
            continue
        for _ in range(each.number):
            if isinstance(each, DiscConfig):
                reach: Tensor | float = draws.within(each.radius_m)
                entries = {"disc_radius_m": reach}
            else:
                reach = each.reach_m
                entries = {"box_heading_rad": draws.within(each.heading_rad)}
            place = _place(each, draws, reach, taken, clearance_m)
            taken.append((place, reach))
            name = each.shape
            for key, value in (entries | {f"{name}_x_m": place.x, f"{name}_y_m": place.y}).items():
                drawn.setdefault(key, []).append(torch.as_tensor(value))
    return {key: torch.stack(values) for key, values in drawn.items()}


def _place(
    obstacle: ObstacleConfig,
    draws: Draws,
    reach_m: Tensor | float,
    taken: list[tuple[Point, Tensor | float]],
    clearance_m: float,
) -> Point:
    """Return the first random place clear of all in ``taken``, or `NOWHERE_M` if none is."""
    words = draws.words(TRIES)
    # Sixteen bits for each coordinate: a resolution of 0.1 mm in 6 m.
    bits = (words >> 16) & 0xFFFF, words & 0xFFFF
    tried = Point(
        *(
            low + (high - low) * (part.to(draws.dtype) * 2.0**-16)
            for (low, high), part in zip(map(span, obstacle.centre_m), bits, strict=True)
        )
    )
    clear = torch.ones_like(tried.x, dtype=torch.bool)
    for place, other_m in taken:
        least_m = reach_m + other_m + clearance_m
        clear = clear & (square(between(place, tried)) > least_m * least_m)
    first = clear.to(torch.int32).argmax(0, keepdim=True)
    return Point(
        *(torch.where(clear.any(0), values.gather(0, first)[0], NOWHERE_M) for values in tried)
    )


def discs_of(
    obstacles: list[ObstacleConfig], drawn: dict[str, Tensor], like: Tensor
) -> Discs | None:
    """Return the discs of a situation, fixed discs first; None if the scene has no discs."""
    fixed = [each for each in obstacles if isinstance(each, DiscConfig) and not each.drawn]
    columns = [[*each.centre_m, each.radius_m] for each in fixed]
    entries = _joined(columns, [drawn.get(key) for key in DRAWN["disc"]], like)
    return Discs(*entries) if entries else None


def boxes_of(
    obstacles: list[ObstacleConfig], drawn: dict[str, Tensor], like: Tensor
) -> Boxes | None:
    """Return the boxes of a situation, fixed boxes first; None if the scene has no boxes."""
    boxes = [each for each in obstacles if isinstance(each, BoxConfig)]
    fixed = [each for each in boxes if not each.drawn]
    loose = [each for each in boxes if each.drawn for _ in range(each.number)]
    columns = [[*each.centre_m, each.heading_rad] for each in fixed]
    entries = _joined(columns, [drawn.get(key) for key in DRAWN["box"]], like)
    if not entries:
        return None
    sizes = [[size / 2 for size in each.size_m] for each in (*fixed, *loose)]
    half_width_m, half_height_m = _joined(sizes, [None, None], like)
    x_m, y_m, heading_rad = entries
    return Boxes(x_m, y_m, half_width_m, half_height_m, heading_rad)


def _joined(fixed: list[list[float]], drawn: list[Tensor | None], like: Tensor) -> list[Tensor]:
    """Return columns ``[objects, *batch]`` of fixed numbers followed by drawn numbers."""
    joined = []
    for number, values in enumerate(drawn):
        parts = [torch.full_like(like, row[number]).unsqueeze(0) for row in fixed]
        parts += [] if values is None else [values]
        joined += [torch.cat(parts)] if parts else []
    return joined
