"""Random scenes for the oracles, and their conversion to the world's types."""

from math import pi

import torch
from hypothesis import strategies as st
from torch import Tensor

from envs.robot.geometry import Boxes, Discs, Point
from tests.oracles import rays

HEADING = st.floats(-pi, pi)
PLACE = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
DISCS = st.lists(
    st.builds(rays.Disc, st.floats(-2, 2), st.floats(-2, 2), st.floats(0.1, 0.8)), max_size=3
)
BOXES = st.lists(
    st.builds(
        rays.Box,
        st.floats(-2, 2),
        st.floats(-2, 2),
        st.floats(0.1, 1.5),
        st.floats(0.1, 1.5),
        HEADING,
    ),
    max_size=2,
)


def real(number: float | list) -> Tensor:
    """Return numbers as a tensor in float64."""
    return torch.tensor(number, dtype=torch.float64)


def point(spot: tuple[float, float]) -> Point:
    """Return a spot as the world's type."""
    return Point(real(spot[0]), real(spot[1]))


def discs(scene: list[rays.Disc]) -> Discs | None:
    """Return discs as the world's type, ``[discs]``, or None if there are none."""
    columns = torch.tensor(scene, dtype=torch.float64).reshape(-1, 3).T
    return Discs(*columns) if scene else None


def boxes(scene: list[rays.Box]) -> Boxes | None:
    """Return boxes as the world's type, ``[boxes]``, or None if there are none."""
    if not scene:
        return None
    x, y, width, height, heading = torch.tensor(scene, dtype=torch.float64).T
    return Boxes(x, y, width / 2, height / 2, heading)
