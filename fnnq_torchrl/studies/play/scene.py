"""The objects of a world as the page draws and moves them."""

from dataclasses import asdict, dataclass
from math import radians
from typing import Any

import torch

from envs.core.world import WorldConfig
from envs.drawing import shot_of
from envs.robot.arena import Arena
from envs.robot.geometry import Boxes, Discs
from envs.robot.played import PLAYED
from envs.robot.scene import SceneConfig

_STARTS = 100
"""The number of situations, of which the page plays one after the other."""

_STILL = "half_size_m", "walls", "radius_m", "track_width_m", "view_rad"
"""The fields of a shot that stay the same in all situations."""


@dataclass(frozen=True)
class Words:
    """A world in words.

    Attributes:
        heading: the page's heading.
        drag: what the reader can drag, and with it what the robots do.
        success, failure: the two ends of a situation.
    """

    heading: str
    drag: str
    success: str
    failure: str


WORDS = {
    "follow_ball": Words(
        "Move the ball",
        "Drag the ball with the mouse or a finger, or move it with the arrow keys. "
        "Both robots chase the same ball",
        "caught",
        "missed",
    ),
    "follow_obstacles": Words(
        "Move the ball and the obstacles",
        "Drag the ball and the obstacles with the mouse or a finger. The arrow keys move one of "
        "them, and Enter chooses the next one. Both robots chase the same ball among the same "
        "obstacles",
        "caught",
        "not caught",
    ),
    "wander": Words(
        "Move the obstacles",
        "Drag the obstacles with the mouse or a finger. The arrow keys move one of them, and Enter "
        "chooses the next one. Both robots drive about among the same obstacles",
        "to the end",
        "collided",
    ),
}
"""The words by the kinds of the worlds that the page can play."""


def scene_of(world: WorldConfig, seed: int, dtype: torch.dtype) -> dict[str, Any]:
    """Return the objects of a world as plain data for the page.

    Args:
        world: the parameters of one of :data:`envs.robot.played.PLAYED`.
        seed: the seed of the run whose first situations the page plays.
        dtype: the type of the numbers.

    Returns:
        ``starts``: each situation's state at its start, by entry; ``shared``: the entries of the
        objects; ``noise``: the entry of the sensors' noise; ``balls``: radius and kind of each;
        ``discs``: x, y and radius of each; ``boxes``: x, y, half the width, half the height and
        the heading of each; ``loose``: for each shape the number of obstacles at the end of the
        list whose places are in the state; ``ring``: the sonars' x, y and heading on the robot;
        ``beam_rad``: the width of their beams; ``circle_m``: the radius of the ball's circle, or
        None; and the fields of :class:`envs.robot.drawing.Shot` that stay the same.
    """
    env = PLAYED[world.kind](world, [_STARTS], dtype=dtype)
    episode = torch.arange(_STARTS).unsqueeze(-1)
    start = env.start(torch.full_like(episode, seed), episode)
    dials = "speed_mps", env.noise
    keys = [key for key in (*env.seen, *env.state_sizes) if key not in dials]
    rows = zip(*(start[key].tolist() for key in keys), strict=True)
    shot = asdict(shot_of(env, start))
    scene: dict[str, Any] = {name: shot[name] for name in _STILL}
    scene |= {
        "starts": [dict(zip(keys, row, strict=True)) for row in rows],
        "shared": [*env.shared],
        "noise": env.noise,
        "balls": [ball[2:] for ball in shot["balls"]],
        "circle_m": getattr(world, "circle_radius_m", None),
        "ring": [],
        "beam_rad": 0.0,
    }
    boxes = discs = None
    if isinstance(env, Arena):
        _, boxes, discs = env.obstacles(dict(start.items()))
    scene |= {"discs": _rows(discs), "boxes": _rows(boxes)}
    scene["loose"] = {
        shape: start[f"{shape}_x_m"].shape[-1] if f"{shape}_x_m" in keys else 0
        for shape in ("disc", "box")
    }
    if isinstance(world, SceneConfig) and (sonar := world.sensors.sonar) is not None:
        scene["ring"] = [[x_m, y_m, radians(turn)] for x_m, y_m, turn in sonar.ring]
        scene["beam_rad"] = radians(sonar.beam_width_deg)
    return scene


def _rows(objects: Discs | Boxes | None) -> list[tuple[float, ...]]:
    """Return the numbers of each obstacle in the first situation."""
    columns = [] if objects is None else [values[:, 0].tolist() for values in objects]
    return [*zip(*columns, strict=True)]
