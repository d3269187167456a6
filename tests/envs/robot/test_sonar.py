"""The sonars: oracle rays, values by hand, mirrored worlds, and statistics of the errors."""

from math import cos, inf, pi, radians, sin, sqrt

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from envs.core.streams import Stream
from envs.robot import sonar
from envs.robot.draws import Draws
from envs.robot.geometry import Sector, Walls
from tests.envs.robot.scenes import BOXES, DISCS, HEADING, PLACE, boxes, discs, point, real
from tests.oracles import rays

FIELD = 4.0, 3.5
AHEAD = sonar.Ring(*(torch.zeros(1, dtype=torch.float64) for _ in range(3)))
FAN = st.floats(1, 120)


def read(spot, heading, width_deg=15.0, max_incidence_deg=None, ring=AHEAD, **scene) -> list[float]:
    limit = None if max_incidence_deg is None else radians(max_incidence_deg)
    sector = Sector(radians(width_deg) / 2, limit)
    return sonar.distances(point(spot), real(heading), ring, sector, **scene).tolist()


@given(PLACE, HEADING, FAN, DISCS, BOXES, st.booleans(), st.sampled_from([None, 22.5, 60.0]))
def test_it_reads_what_the_nearest_ray_meets(
    spot, heading, width_deg, round_ones, square_ones, walled, limit
):
    """The reading lies between the rays' readings with a slightly wider and a narrower beam."""
    walls = Walls(FIELD[0] / 2, FIELD[1] / 2) if walled else None
    (exact,) = read(
        spot,
        heading,
        width_deg,
        limit,
        walls=walls,
        boxes=boxes(square_ones),
        discs=discs(round_ones),
    )
    scene = round_ones, square_ones, rays.field(*FIELD) if walled else []
    wider, narrower = (
        rays.reading(
            spot,
            heading,
            radians(width_deg) + sign * 2e-7,
            *scene,
            max_incidence_deg=limit and limit + sign * 1e-5,
        )
        for sign in (1, -1)
    )
    assert wider - 1e-5 <= exact <= narrower + 1e-5


@settings(max_examples=10)
@given(PLACE, HEADING, FAN, DISCS, BOXES)
def test_it_lies_between_two_fans_of_20_000_rays(spot, heading, width_deg, round_ones, square_ones):
    """The second fan is wider by the angle between two rays."""
    (exact,) = read(
        spot,
        heading,
        width_deg,
        walls=Walls(FIELD[0] / 2, FIELD[1] / 2),
        boxes=boxes(square_ones),
        discs=discs(round_ones),
    )
    scene, number = (round_ones, square_ones, rays.field(*FIELD)), 20_000
    fan, wider = (
        rays.reading(spot, heading, radians(width_deg) * factor, *scene, rays=number)
        for factor in (1, number / (number - 1))
    )
    assert wider - 1e-9 <= exact <= fan + 1e-9


@pytest.mark.parametrize(
    ("heading", "walls", "distance"),
    [
        (0, Walls(2, 1), 2),  # straight at a wall
        (radians(7), Walls(2, 1), 2),  # the perpendicular is still in the beam
        (radians(30), Walls(2, 9), 2 / cos(radians(22.5))),  # the beam's nearer edge
        (pi / 4, Walls(2, 2), 2 / cos(radians(37.5))),  # into a corner: an edge meets a wall
        (0, None, inf),
    ],
)
def test_walls_by_hand(heading, walls, distance):
    assert read((0, 0), heading, walls=walls) == [pytest.approx(distance, abs=1e-12)]


@pytest.mark.parametrize(
    ("disc", "distance"),
    [
        ((2, 0, 0.5), 1.5),  # towards its centre
        ((-2, 0, 0.5), inf),  # behind
        ((2, 0.1, 0.5), sqrt(4.01) - 0.5),
        ((2, 2, 0.1), inf),  # beside the beam
        ((0.3, 0, 0.5), 0),  # inside
    ],
)
def test_discs_by_hand(disc, distance):
    assert read((0, 0), 0, discs=discs([rays.Disc(*disc)])) == [pytest.approx(distance, abs=1e-12)]


def test_a_disc_beside_the_middle_of_the_beam_is_met_by_its_edge():
    edge = radians(7.5)
    away, off = 2.0, 0.3  # of the centre, along the edge and off it
    disc = rays.Disc(away * cos(edge) - off * sin(edge), away * sin(edge) + off * cos(edge), 0.5)
    assert read((0, 0), 0, discs=discs([disc])) == [pytest.approx(away - 0.4, abs=1e-12)]


def test_a_box_shows_its_sides_and_inside_it_there_is_no_way():
    box = [rays.Box(2, 0, 1, 1, 0)]
    assert read((0, 0), 0, boxes=boxes(box)) == [pytest.approx(1.5)]
    assert read((2.2, 0.1), 0, boxes=boxes(box)) == [0]


def test_a_smooth_wall_that_is_met_aslant_gives_no_echo_but_its_corners_do():
    walls = Walls(2, 2)
    aslant = radians(45)
    (corner,) = read((0, 0), aslant, max_incidence_deg=22.5, walls=walls)
    assert corner == pytest.approx(2 * sqrt(2))
    assert read((0, 0), radians(32), max_incidence_deg=22.5, walls=walls) == [inf]
    assert read((0, 0), radians(20), max_incidence_deg=22.5, walls=walls)[0] < 2.1


def test_what_gives_no_echo_hides_nothing():
    """A slanted board gives no echo, so the sonar reads the disc behind it."""
    board = rays.Box(1, 0, 0.02, 3, radians(50))
    disc = rays.Disc(2, 0, 0.3)
    scene = {"discs": discs([disc]), "boxes": boxes([board])}
    assert read((0, 0), 0, max_incidence_deg=22.5, **scene) == [pytest.approx(1.7)]
    assert read((0, 0), 0, **scene)[0] < 1.1


@given(PLACE, HEADING, DISCS, BOXES)
def test_in_a_mirrored_world_the_readings_are_mirrored(spot, heading, round_ones, square_ones):
    ring = sonar.Ring(
        *(torch.tensor(values).double() for values in ([0.1, 0.1], [0.2, -0.2], [0.7, -0.7]))
    )
    walls = Walls(2, 1.75)
    here = {"discs": discs(round_ones), "boxes": boxes(square_ones), "walls": walls}
    mirrored = {
        "discs": discs([disc._replace(y=-disc.y) for disc in round_ones]),
        "boxes": boxes([box._replace(y=-box.y, heading=-box.heading) for box in square_ones]),
        "walls": walls,
    }
    left, right = read(spot, heading, ring=ring, **here)
    swapped = read((spot[0], -spot[1]), -heading, ring=ring, **mirrored)
    assert [right, left] == [pytest.approx(value, abs=1e-6) for value in swapped]


def test_a_reading_jumps_only_where_an_object_enters_or_leaves():
    disc = discs([rays.Disc(2, 0, 0.4)])
    turns = torch.linspace(-1, 1, 2001, dtype=torch.float64)
    still = point((0, 0))
    place = type(still)(still.x.expand(2001), still.y.expand(2001))
    sector = Sector(radians(7.5))
    disc = type(disc)(*(values[:, None] for values in disc))
    ways = sonar.distances(place, turns, AHEAD, sector, discs=disc)
    seen = ways[0].isfinite()
    assert (seen[1:] != seen[:-1]).sum() == 2
    steps = ways[0][seen].diff().abs()
    assert steps.max() < 0.05
    reach = float(turns[seen].max())
    assert reach == pytest.approx(radians(7.5) + torch.asin(real(0.2)).item(), abs=1e-3)


# -- errors ---------------------------------------------------------------------------------------


def noisy(distance: float, number: int = 20_000, **settings: float) -> torch.Tensor:
    settings = {"noise_m": 0.01, "noise_share": 0.01, "dropout": 0.0} | settings
    seed = torch.arange(number)
    draws = Draws(seed, seed * 0, seed * 0 + 3, Stream.SENSORS, torch.float64)
    return sonar.readings(
        torch.full((1, number), distance, dtype=torch.float64),
        draws.normals(1),
        draws.chances(1, settings["dropout"]),
        noise_m=settings["noise_m"],
        noise_share=settings["noise_share"],
        range_m=(0.0, 5.0),
    )


def test_the_error_grows_with_the_distance():
    for distance in (0.5, 2.0, 4.0):
        error = noisy(distance) - distance
        sigma = 0.01 + 0.01 * distance
        assert abs(float(error.mean())) < 5 * sigma / sqrt(20_000)
        assert float(error.std()) == pytest.approx(sigma, rel=0.03)


def test_so_many_echoes_are_lost():
    lost = noisy(2.0, dropout=0.1) == 5.0
    assert float(lost.double().mean()) == pytest.approx(0.1, abs=0.01)


def test_readings_stay_within_the_range():
    assert noisy(0.0).min() == 0
    assert noisy(4.99).max() <= 5
    assert noisy(5.01).eq(5).all()
    assert noisy(inf).eq(5).all()
