"""Where obstacles are in a situation: fixed ones, and those drawn where there is room."""

import torch
from torch import Tensor

from envs.robot.draws import Draws
from envs.robot.geometry import Boxes, Discs, Point, between, square
from envs.robot.scene import BoxConfig, DiscConfig, ObstacleConfig, span

DRAWN = {
    "disc": ("disc_x_m", "disc_y_m", "disc_radius_m"),
    "box": ("box_x_m", "box_y_m", "box_heading_rad"),
}
"""The entries of the obstacles that are drawn, by their shapes."""

TRIES = 12
"""Places that are tried for an obstacle; one that finds no room isn't in this situation."""

NOWHERE_M = 1e4
"""Where an obstacle lies that isn't in this situation: far beyond every sensor's range."""


def draw_obstacles(
    obstacles: list[ObstacleConfig],
    draws: Draws,
    keep_clear: list[tuple[Point, float]],
    clearance_m: float,
) -> dict[str, Tensor]:
    """Draw the obstacles that aren't fixed, one after the other.

    Each is put where it is clear of the others, fixed ones included, by its greatest reach.

    Args:
        obstacles: the scene's.
        draws: the random numbers of a situation.
        keep_clear: places ``[*batch]`` and radii of what they must not overlap either.
        clearance_m: the least gap.

    Returns:
        The entries of `DRAWN`, ``[discs, *batch]`` and ``[boxes, *batch]``, if any is drawn.
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
    """The first of some random places that is clear of all that is there, or nowhere."""
    words = draws.words(TRIES)
    # Sixteen bits for either: a tenth of a millimetre in six metres.
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
    """The discs of a situation, the fixed ones first; None if the scene has none."""
    fixed = [each for each in obstacles if isinstance(each, DiscConfig) and not each.drawn]
    columns = [[*each.centre_m, each.radius_m] for each in fixed]
    entries = _joined(columns, [drawn.get(key) for key in DRAWN["disc"]], like)
    return Discs(*entries) if entries else None


def boxes_of(
    obstacles: list[ObstacleConfig], drawn: dict[str, Tensor], like: Tensor
) -> Boxes | None:
    """The boxes of a situation, the fixed ones first; None if the scene has none."""
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
    """Columns of fixed numbers, each followed by those that are drawn, ``[objects, *batch]``."""
    joined = []
    for number, values in enumerate(drawn):
        parts = [torch.full_like(like, row[number]).unsqueeze(0) for row in fixed]
        parts += [] if values is None else [values]
        joined += [torch.cat(parts)] if parts else []
    return joined
