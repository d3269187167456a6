import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from matplotlib.text import Text

from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.figures.command import main
from fnnq_torchrl.studies.figures.gallery import FIGURES, draw
from fnnq_torchrl.studies.figures.job_words import change_words, job_words
from fnnq_torchrl.studies.figures.lines import lines_figure
from fnnq_torchrl.studies.figures.outliers import FAR, limits
from fnnq_torchrl.studies.figures.readings import norms
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import bootstrap_interval
from tests.experiment_files import (
    EXPERIMENTS,
    grid,
    invent_experiment,
    paper_level,
    write_experiment,
)
from tests.studies.test_figures import texts

Experiments = dict[str, Experiment]


@pytest.mark.parametrize("name", FIGURES)
def test_nothing_is_clipped_and_no_words_collide(name: str, experiments: Experiments) -> None:
    experiment, picture = FIGURES[name]
    figure = picture(experiments[experiment])
    shown = texts(figure)
    boxes = [Text.get_window_extent(text) for text in shown]
    width, height = figure.bbox.size
    for index, box in enumerate(boxes):
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= width
        assert box.y1 <= height
        hit = [other for other in range(index + 1, len(boxes)) if box.overlaps(boxes[other])]
        assert not hit, [shown[i].get_text() for i in (index, *hit)]
    words = " ".join(text.get_text() for text in shown)
    assert re.search("(12|110) runs", words)
    assert "interval" in words


@pytest.mark.parametrize("name", FIGURES)
def test_every_axis_says_what_it_shows(name: str, experiments: Experiments) -> None:
    experiment, picture = FIGURES[name]
    for axes in picture(experiments[experiment]).axes:
        scale_of_colours = axes.get_label() == "<colorbar>"
        assert axes.get_ylabel() or axes.get_yticklabels() or scale_of_colours
        assert axes.get_xlabel() or axes.get_ylabel()  # a colour bar has only one


def test_lines_and_bands_are_the_files_means_and_intervals(experiments: Experiments) -> None:
    experiment = experiments["decay"]
    left, right = lines_figure(
        experiment, "alpha_decay", "alpha", ["final_score", "forgetting"]
    ).axes
    for axes, measure in ((left, "final_score"), (right, "forgetting")):
        for line, alpha in zip(axes.lines, [0.1, 0.4], strict=True):
            jobs = [experiment.job(alpha=alpha, alpha_decay=d) for d in (0.9, 0.97, 0.99, 0.997, 1)]
            scores = [MEASURES[measure].of(job.evaluations) for job in jobs]
            assert line.get_ydata().tolist() == [bootstrap_interval(np.mean, s)[0] for s in scores]
        ticks = [label.get_text() for label in axes.get_xticklabels()]
        assert ticks == ["0.9", "0.97", "0.99", "0.997", "1"]


@given(lowest=st.floats(3, 4), span=st.floats(0.1, 1), gap=st.floats(0.01, 4))
def test_only_a_value_far_below_the_others_is_left_out(
    lowest: float, span: float, gap: float
) -> None:
    others = np.linspace(lowest, lowest + span, 20)
    values = np.append(others, lowest - gap)
    found = limits(values, values - 0.01, values + 0.01)
    assert found.low < others.min()
    assert found.high > others.max()
    ratio = (others.min() - values[-1]) / np.ptp(others)
    assume(abs(ratio - FAR) > 1e-6)
    assert (values[-1] < found.low) == (ratio > FAR)


def test_values_below_an_axis_are_told_beside_it() -> None:
    jobs = grid({"trace": "output,gradient", "lam": "0,0.2,0.4,0.6,1"})
    low = ("output", 1.0)
    traces = invent_experiment(
        "traces",
        jobs,
        lambda job: 0.5 if (job["trace"], job["lam"]) == low else 4.5 + job["lam"] / 10,
        runs=20,
    )
    figure = lines_figure(traces, "lam", "trace", ["mean_score"])
    (axes,) = figure.axes
    bottom = axes.get_ylim()[0]
    outlier = traces.job(trace="output", lam=1.0).evaluations.mean_score.mean()
    assert outlier < 1 < 3 < bottom
    assert f"{outlier:.2f}" in [text.get_text() for text in axes.texts]
    assert axes.lines[0].get_xdata().tolist() == [0, 1, 2, 3]
    assert axes.lines[1].get_xdata().tolist() == [0, 1, 2, 3, 4]
    assert any("beyond the axis" in text.get_text() for text in texts(figure))


def test_the_norms_lie_where_they_are_drawn(experiments: Experiments) -> None:
    norm = norms(experiments["traces"])
    assert norm.argmin() % 201 == pytest.approx(100, abs=10)  # labels overlap most straight ahead
    assert norm[0, 0] == pytest.approx(norm.max())  # one rule dominates at the corners
    np.testing.assert_allclose(norm, norm[::-1, ::-1], rtol=1e-6)


def test_rows_name_what_sets_them_apart(experiments: Experiments) -> None:
    rows = [job_words(e, job) for e in [experiments["exploration"]] for job in e.jobs]
    assert rows[0] == "ε-greedy, ε = 0"
    assert rows[-1] == "additive noise, σ = 1"
    variants = experiments["variants"]
    assert job_words(variants, variants.jobs[-1], "lam") == "Peng, finite window, steps = 5"
    choices = experiments["open_choices"]
    rows = [change_words(choices, job, "lam") for job in choices.jobs]
    assert rows[0] == rows[1] == "default"
    assert rows[2] == "V₀ = 0.2 m/s"
    assert "step h by gradient" in rows
    assert len(set(rows)) == len(rows) / 2


def test_one_run_has_no_interval_but_a_picture(tmp_path: Path) -> None:
    jobs = grid({"trace": "output,gradient", "lam": "0,0.3"})
    traces = invent_experiment("traces", jobs, lambda settings: 3, runs=1)
    files = draw({"traces": traces}, tmp_path / "figures")
    assert [path.name for path in files] == ["traces.png", "traces.svg"]
    assert all(path.stat().st_size > 1000 for path in files)


def test_the_same_results_give_the_same_files(experiments: Experiments, tmp_path: Path) -> None:
    fig3 = {"fig3": experiments["fig3"]}
    first, second = (draw(fig3, tmp_path / folder) for folder in ("one", "two"))
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    results, figures = tmp_path / "outputs", tmp_path / "figures"
    write_experiment(results / "fig3" / "2026-01-02_03-04-05", EXPERIMENTS["fig3"], paper_level, 3)
    arguments = ["--results", str(results), "--to", str(figures)]
    monkeypatch.setattr("sys.argv", ["figures", "fig3", *arguments])
    main()
    assert {path.name for path in figures.iterdir()} == {"fig3.png", "fig3.svg"}
    monkeypatch.setattr("sys.argv", ["figures", "fig7", *arguments])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert "there is no figure fig7; there is fig2, fig3" in capsys.readouterr().err
    monkeypatch.setattr("sys.argv", ["figures", "fig3", "--results", str(figures)])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    assert "fig3 has no finished results" in capsys.readouterr().err


def test_a_missing_combination_is_told() -> None:
    jobs = grid({"trace": "output,gradient", "lam": "0,0.3"})[:-1]
    traces = invent_experiment("traces", jobs, lambda settings: 3, runs=2)
    with pytest.raises(NoResults, match=r"0 jobs with lam=0\.3 trace=gradient"):
        FIGURES["traces"][1](traces)
