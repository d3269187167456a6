"""The comparison of Stream Q(λ) with its authors' program: its measure, its files and its page."""

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stream_q.page import FUZZY, OURS, THEIRS, Series, figure_of, write_page
from benchmarks.stream_q.results import (
    PARTS,
    Measured,
    grouped,
    in_parts,
    read_measured,
    write_measured,
)


def test_a_part_has_the_mean_return_of_its_steps() -> None:
    # Episodes end after 3, 4 and 30 steps; the last return holds for the steps that follow.
    found = in_parts([3, 4, 30], [10, 6, 2], 2 * PARTS)
    assert found.tolist() == [10, 8] + [2] * (PARTS - 2)


def test_groups_have_the_means_of_their_episodes() -> None:
    ends, means = grouped([4, 9, 11, 20, 21], [1.0, 3.0, 5.0, 7.0, 8.0], 2)
    assert ends == [9, 20, 21]
    assert means == [2, 6, 8]


def test_measured_runs_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "theirs.csv"
    assert read_measured(path) == []
    run = Measured(
        "acrobot", 50_000, 3, "2026-11-26", tuple(np.linspace(-500, -80, PARTS).round(2))
    )
    first = Measured("acrobot", 50_000, 1, "2026-11-25", run.returns)
    write_measured([run, first], path)
    assert read_measured(path) == [first, run]


def series(task: str, who: str, runs: int, final: float) -> Series:
    noise = np.random.default_rng(0).normal(size=(runs, PARTS))
    return Series(task, who, 50_000, np.linspace(0, final, PARTS) + 0.01 * noise)


@pytest.mark.parametrize(
    ("ours", "words"),
    [(9.0, "ours earns more than"), (2.0, "ours earns less than"), (5.0, "neither clearly more")],
)
def test_the_page_says_who_earns_more(ours: float, words: str) -> None:
    both = [series("acrobot", OURS, 20, ours), series("acrobot", THEIRS, 3, 5.0)]
    page = write_page(both, ["2026-11-26", "2026-11-25"])
    assert words in page
    assert "on 2026-11-25 to 2026-11-26." in page
    assert "| Acrobot-v1" in page


def test_the_page_says_how_many_balls_are_caught() -> None:
    three = [
        series("follow", OURS, 20, 0.1),
        series("follow", THEIRS, 1, 0.5),
        series("follow", FUZZY, 20, 0.9),
    ]
    page = write_page(three, ["2026-11-26"])
    # The returns of the last fifth are below the final one; a catch is worth 1, a miss −0.5.
    assert re.search(r"Stream Q\(λ\) 39% \[.*program 64%, .*defaults 89% \[", page)
    assert "on 2026-11-26." in page
    assert "too hard" not in page
    assert re.search(r"\| the paper's ball \| +ours \| .* 0\.\d\d \|\n", page)
    assert len(figure_of(three).axes) == 3


def test_a_learned_ball_says_that_the_world_is_not_too_hard() -> None:
    learned = Series("follow", OURS, 50_000, np.full((4, PARTS), 0.99))
    assert "99% [99%, 99%]. So the world isn't too hard" in write_page([learned], ["2026-11-26"])
