from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from numpy.typing import NDArray

from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.curve import Curve
from fnnq_torchrl.training.pictures.curves import (
    curves_figure,
    learning_curve,
    learning_curve_figure,
)
from fnnq_torchrl.training.pictures.style import spread
from fnnq_torchrl.training.results import Evaluations
from fnnq_torchrl.training.score import Score

CATCHES = Score("successes", 0, 5, "catches")
UNBOUNDED = Score()


def evaluations(lams: list[float], runs: int, count: int = 41, best: int = 5) -> Evaluations:
    shape = (len(lams) * runs, count)
    return Evaluations(
        seed=np.tile(np.arange(runs), len(lams)),
        lam=np.repeat(lams, runs).astype(np.float64),
        situations=5 * np.arange(count),
        steps=np.full(shape, 7),
        catches=np.random.default_rng(0).integers(0, best + 1, size=shape),
        diverged=np.zeros(shape, dtype=bool),
        returns=np.zeros(shape),
        lengths=np.zeros(shape),
    )


def texts(figure: Figure) -> list[Text]:
    """Return all texts of a picture, without the labels of ticks beyond an axis (not drawn)."""
    figure.draw_without_rendering()
    undrawn = {
        tick.label1
        for axis in figure.findobj(Axis)
        for tick in axis.get_major_ticks()
        if not axis.get_view_interval()[0] <= tick.get_loc() <= axis.get_view_interval()[1]
    }
    return [
        text
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text() and text not in undrawn
    ]


CASES = {
    "one run": evaluations([0.2], 1),
    "the paper's": evaluations([0, 0.1, 0.4, 0.8], 22),
    "one evaluation": evaluations([0.2], 22, count=2),
    "ends that coincide": evaluations([0.1, 0.2, 0.3], 2, best=0),
    "more curves than colours": evaluations(np.linspace(0, 1, 11).tolist(), 2),
    "more curves than panels": evaluations(np.linspace(0, 1, 41).tolist(), 2),
    "long numbers": evaluations([1 / 3, 2 / 3], 12_345, count=3),
}


@pytest.mark.parametrize("case", CASES)
def test_nothing_is_clipped_and_no_labels_collide(case: str) -> None:
    figure = learning_curve_figure(CASES[case], CATCHES)
    boxes = [Text.get_window_extent(text) for text in texts(figure)]  # without labels' links
    width, height = figure.bbox.size
    for box in boxes:
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= width
        assert box.y1 <= height
    for index, box in enumerate(boxes):
        assert box.count_overlaps(boxes[index + 1 :]) == 0


def test_curves_and_bands_are_the_file_s_means_and_intervals() -> None:
    data = CASES["the paper's"]
    (axes,) = learning_curve_figure(data, CATCHES).axes
    for line, band, lam in zip(axes.lines, axes.collections, [0, 0.1, 0.4, 0.8], strict=True):
        mean, low, high = mean_interval(data.catches[data.lam == lam], bounds=(0, 5))
        np.testing.assert_array_equal(line.get_ydata(), mean)
        corners = {(x, y) for x, y in band.get_paths()[0].vertices}
        assert set(zip(data.situations, low, strict=True)) <= corners
        assert set(zip(data.situations, high, strict=True)) <= corners


def test_every_label_is_linked_to_the_end_of_its_curve() -> None:
    (axes,) = learning_curve_figure(CASES["the paper's"], CATCHES).axes
    for line, label, lam in zip(axes.lines, axes.texts, ["0", "0.1", "0.4", "0.8"], strict=True):
        assert isinstance(label, Annotation)
        assert label.get_text() == f"λ = {lam}"
        assert label.get_color() == line.get_color()
        assert label.xy == (1.0, np.asarray(line.get_ydata())[-1])


@pytest.mark.parametrize(
    ("data", "title", "caption"),
    [
        (
            evaluations([0.2], 22),
            "Learning curve for λ = 0.2, 22 runs",
            "line: mean over 22 runs; band: its 95 % confidence interval (Student's t), at most ",
        ),
        (
            evaluations([0, 0.4], 1000, count=3),
            "Learning curves for 2 values of λ, 1,000 runs each",
            "line: mean over 1,000 runs; band: its 95 % confidence interval",
        ),
        (
            evaluations([0.2], 1),
            "Learning curve for λ = 0.2, 1 run",
            "line: a single run, which has no confidence interval",
        ),
    ],
    ids=["one λ", "two λs", "one run"],
)
def test_the_words_come_from_the_data(data: Evaluations, title: str, caption: str) -> None:
    shown = [text.get_text() for text in texts(learning_curve_figure(data, CATCHES))]
    assert title in shown
    assert any(text.startswith(caption) for text in shown)
    assert {text for text in shown if text.startswith("λ = ")} == {
        f"λ = {lam:g}" for lam in np.unique(data.lam)
    }


def test_unequal_numbers_of_runs_are_told() -> None:
    data = evaluations([0.1, 0.2], 3)
    rest = Evaluations(
        data.seed[1:],
        data.lam[1:],
        data.situations,
        data.steps[1:],
        data.catches[1:],
        data.diverged[1:],
        data.returns[1:],
        data.lengths[1:],
    )
    shown = [text.get_text() for text in texts(learning_curve_figure(rest, CATCHES))]
    assert "Learning curves for 2 values of λ, 2 to 3 runs each" in shown


def test_the_score_axis_begins_at_zero_and_holds_the_best() -> None:
    data = evaluations([0.2], 5, best=2)
    for score, top in ((UNBOUNDED, 2), (CATCHES, 5)):
        (axes,) = learning_curve_figure(data, score).axes
        low, high = axes.get_ylim()
        assert low == 0
        assert top < high < top + 0.5


def test_the_axis_above_counts_the_evaluations() -> None:
    (axes,) = learning_curve_figure(evaluations([0.2], 2, count=41), CATCHES).axes
    (above,) = axes.child_axes
    labels = [label.get_text() for label in above.get_xticklabels()]
    assert labels == ["0", "5", "10", "15", "20", "25", "30", "35", "40"]
    np.testing.assert_array_equal(above.get_xticks(), 5 * np.array(labels, dtype=int))


def test_the_picture_is_written_and_the_same_each_time(tmp_path: Path) -> None:
    for name in ("one.png", "two.png"):
        learning_curve(CASES["the paper's"], tmp_path / name, CATCHES)
    picture = (tmp_path / "one.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert picture == (tmp_path / "two.png").read_bytes()


def test_an_unknown_format_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not supported"):
        learning_curve(CASES["one run"], tmp_path / "picture.xyz", CATCHES)
    assert not [*tmp_path.iterdir()]


@given(
    heights=hnp.arrays(np.float64, st.integers(1, 12), elements=st.floats(0, 5)),
    gap=st.floats(0.01, 0.4),
)
def test_spread_heights_keep_their_distance_their_order_and_the_bounds(
    heights: NDArray[np.float64], gap: float
) -> None:
    moved = spread(heights, gap, low=0, high=5)
    order = np.argsort(heights, kind="stable")
    assert np.all(np.diff(moved[order]) >= gap - 1e-9)
    assert moved.min() >= 0
    assert moved.max() <= 5 + 1e-9
    if np.all(np.diff(heights[order]) >= gap):
        np.testing.assert_allclose(moved, heights, atol=1e-9)


def test_labels_that_coincide_move_apart_evenly() -> None:
    np.testing.assert_allclose(spread(np.array([2.0, 2.0, 4.0]), 0.5, 0, 5), [1.75, 2.25, 4.0])


def curve(label: str, score: int, count: int = 5) -> Curve:
    return Curve(label, 5 * np.arange(count), np.full((2, count), score), diverged=0)


@pytest.mark.parametrize("count", [8, 12, 25])
def test_more_curves_than_colours_have_a_panel_each(count: int) -> None:
    scores = np.random.default_rng(0).permutation(count)
    curves = [curve(f"score {score}", score) for score in scores]
    figure = curves_figure(curves, "configurations", UNBOUNDED)
    panels = [axes for axes in figure.axes if axes.get_visible()]
    best = [score for score in scores if score >= count - 20]  # in the order they came in
    assert [axes.get_title() for axes in panels] == [f"score {score}" for score in best]
    for axes, score in zip(panels, best, strict=True):
        (line,) = axes.lines
        assert set(line.get_ydata()) == {score}
        (grey,) = (c for c in axes.collections if isinstance(c, LineCollection))
        assert sorted(points[-1, 1] for points in grey.get_segments()) == [*range(count)]
    title = f"Learning curves for {count} configurations, 2 runs each"
    shown = [text.get_text() for text in texts(figure)]
    assert (title if count <= 20 else f"{title}: the best 20") in shown


@pytest.mark.parametrize(
    ("score", "words"),
    [
        (CATCHES, "score (catches of 5)"),
        (Score("successes", 0, 3, "arrivals"), "score (arrivals of 3)"),
        (Score("return", -1, 1), "return, mean over the test's episodes"),
        (Score("length", 0, 99), "steps of an episode, mean over the test's"),
    ],
)
def test_the_axis_has_the_worlds_words(score: Score, words: str) -> None:
    for count in (2, 8):
        curves = [curve(str(number), 1) for number in range(count)]
        assert words in {text.get_text() for text in texts(curves_figure(curves, "x", score))}


def test_no_band_leaves_the_bounds() -> None:
    scores = np.array([[4, 5, 5], [5, 5, 0]])
    (axes,) = curves_figure([Curve("", 5 * np.arange(3), scores, 0)], "", CATCHES).axes
    (band,) = axes.collections
    heights = band.get_paths()[0].vertices[:, 1]
    assert (heights.min(), heights.max()) == (0, 5)


def test_curves_may_end_at_different_situations() -> None:
    figure = curves_figure(
        [curve("short", 1, count=3), curve("long", 2, count=5)], "configurations", CATCHES
    )
    (axes,) = figure.axes
    assert axes.get_xlim() == (0, 20)
    assert [label.xy for label in axes.texts] == [(0.5, 1.0), (1.0, 2.0)]


def test_long_labels_are_not_clipped_and_leave_the_curves_their_room() -> None:
    label = "α = 0.8768, α decay = 0.986, λ = 0.3388, ε = 0.3968"
    figure = curves_figure([curve(label, 1), curve("other", 2)], "configurations", CATCHES)
    boxes = [Text.get_window_extent(text) for text in texts(figure)]
    assert max(box.x1 for box in boxes) <= figure.bbox.width
    (axes,) = figure.axes
    assert axes.get_window_extent().width >= 5 * figure.dpi


def test_configurations_of_one_run_stand_beside_others() -> None:
    one, more = curve("one", 1), curve("more", 2)
    figure = curves_figure([one._replace(scores=one.scores[:1]), more], "x", CATCHES)
    shown = [text.get_text() for text in texts(figure)]
    assert any(text.startswith("line: mean over 1 to 2 runs; band: ") for text in shown)
