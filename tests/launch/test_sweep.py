"""The files of a sweep, which are made from the result files of its jobs."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from fnnq_torchrl.config.identity import WHICH_RUNS, JobRuns
from fnnq_torchrl.launch import sweep as module
from fnnq_torchrl.launch.sweep import SweptResult, draw_whole, swept_keys, write_sweep
from fnnq_torchrl.training.pictures.curve import Curve
from fnnq_torchrl.training.results import (
    Outcome,
    read_evaluations,
    summarise,
    write_evaluations,
    write_summary,
)
from fnnq_torchrl.training.score import Score

CATCHES = Score("successes", 0, 5, "catches")
Make = Callable[..., SweptResult]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Return a function that makes a job, with result files if ``catches`` are given."""

    def make(number: int, catches: Sequence[Sequence[int]] | None, **overrides: str) -> SweptResult:
        directory = tmp_path / str(number)
        directory.mkdir()
        seed, others = int(overrides.get("seed", 0)), {*overrides} - {*WHICH_RUNS}
        seeds = range(seed, seed + len(catches or [()]))
        if catches is not None:
            scores = np.array(catches)
            outcome = Outcome(
                seed=np.array(seeds),
                lam=np.full(len(scores), float(overrides.get("lam", 0.2))),
                situations=5 * np.arange(scores.shape[1]),
                steps=10 * np.arange(scores.size).reshape(scores.shape),
                catches=scores,
                diverged=np.zeros(scores.shape, dtype=bool),
                batch_runs=9,
                batch_learning_steps=900,
                train_seconds=3.0,
                compile_seconds=2.0,
                evaluate_seconds=1.0,
                returns=np.zeros(scores.shape),
                lengths=np.zeros(scores.shape),
            )
            write_evaluations(directory / "evaluations.csv", outcome)
            write_summary(directory / "summary.json", summarise(outcome))
        configuration = repr(sorted((key, overrides[key]) for key in others))
        return SweptResult(number, overrides, directory, CATCHES, JobRuns(configuration, seeds))

    return make


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, list[Curve], Score]]:
    pictures: list[tuple[str, list[Curve], Score]] = []

    def draw_sweep(curves: list[Curve], of: str, picture: Path, score: Score) -> None:
        pictures.append((of, curves, score))

    monkeypatch.setattr(module, "draw_sweep", draw_sweep)
    return pictures


def write_whole(directory: Path, jobs: Sequence[SweptResult], first: int = 0) -> None:
    write_sweep(directory, jobs, first)
    draw_whole(directory, jobs)


def rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_swept_is_what_differs(make: Make) -> None:
    jobs = [
        make(0, None, lam="0", alpha="0.4", seed="1", trace="output"),
        make(1, None, lam="0", alpha="0.3", seed="2"),
    ]
    assert swept_keys(jobs) == ["alpha", "seed", "trace"]


def test_every_swept_key_is_a_column(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    labels = "[[-1,0.4],[1,0.4]]"
    jobs = [
        make(0, [[0, 2, 4]], alpha="0.4", seed="0", **{"value.action": labels}),
        make(1, [[1, 3, 5], [2, 3, 4]], alpha="0.4", seed="7", **{"value.action": "[[0,1]]"}),
    ]
    write_whole(tmp_path, jobs)
    evaluations = rows(tmp_path / "evaluations.csv")
    assert list(evaluations[0]) == [
        *("seed", "lam", "situations", "steps", "catches"),
        *("diverged", "return", "length", "alpha", "temperature", "gamma", "job", "value.action"),
    ]
    assert [row["catches"] for row in evaluations] == list("024135234")
    assert [row["value.action"] for row in evaluations] == [labels] * 3 + ["[[0,1]]"] * 6
    assert [row["job"] for row in evaluations] == list("000111111")

    first, second = rows(tmp_path / "summary.csv")
    assert list(first)[:3] == ["job", "seed", "value.action"]
    assert (first["value.action"], second["value.action"]) == (labels, "[[0,1]]")
    assert (first["runs"], second["runs"]) == ("1", "2")
    assert (first["batch_runs"], first["lam"]) == ("9", "0.2")
    assert (first["mean_score"], second["mean_score"]) == ("3.0", "3.75")
    assert first["mean_score_low"] == ""
    low, high = float(second["mean_score_low"]), float(second["mean_score_high"])
    assert low < 3.75 < high
    assert (low + high) / 2 == pytest.approx(3.75)


def test_swept_situations_are_not_those_of_a_row(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    jobs = [make(0, [[0, 2]], situations="5"), make(1, [[1, 3]], situations="10")]
    write_whole(tmp_path, jobs)
    evaluations = rows(tmp_path / "evaluations.csv")
    assert [row["config.situations"] for row in evaluations] == ["5", "5", "10", "10"]


def test_the_evaluations_are_read_as_those_of_a_job_are(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    jobs = [make(0, [[0, 2], [1, 1]], lam="0.1", x="a,b"), make(1, [[3, 4]], lam="0.5", x="c")]
    write_whole(tmp_path, jobs)
    whole = read_evaluations(tmp_path / "evaluations.csv")
    assert whole.lam.tolist() == [0.1, 0.1, 0.5]
    assert whole.catches.tolist() == [[0, 2], [1, 1], [3, 4]]


def test_a_curve_for_each_configuration_over_its_seeds(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    jobs = [
        make(0, [[0, 1]], lam="0.4", seed="0"),
        make(1, [[0, 2]], lam="0.4", seed="1"),
        make(2, [[0, 3]], lam="0", seed="0"),
        make(3, [[0, 4]], lam="0", seed="1"),
    ]
    write_whole(tmp_path, jobs)
    [(of, curves, score)] = drawn
    assert (of, score) == ("values of λ", CATCHES)
    assert [curve.label for curve in curves] == ["λ = 0.4", "λ = 0"]
    assert [curve.scores.tolist() for curve in curves] == [[[0, 1], [0, 2]], [[0, 3], [0, 4]]]


def test_a_configuration_has_all_its_swept_values_in_its_label(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    jobs = [
        make(0, [[0, 1]], alpha="0.312345", lam="0.1", trace="output"),
        make(1, [[0, 2]], alpha="0.4", lam="0.1", trace="gradient"),
    ]
    write_whole(tmp_path, jobs)
    [(of, curves, _)] = drawn
    assert of == "configurations"
    assert [curve.label for curve in curves] == [
        "α = 0.3123, trace = output",
        "α = 0.4, trace = gradient",
    ]


def test_seeds_alone_are_one_configuration(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    write_whole(tmp_path, [make(0, [[0, 1]], seed="0"), make(1, [[0, 2]], seed="1")])
    [(_, [curve], _)] = drawn
    assert (curve.label, curve.scores.tolist()) == ("λ = 0.2", [[0, 1], [0, 2]])


def test_runs_that_jobs_share_count_once(
    make: Make,
    tmp_path: Path,
    drawn: list[tuple[str, list[Curve], Score]],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A search proposes a point twice, and seeds overlap: four distinct runs of six, and three."""
    first, second, third, fourth = ([0, 1], [0, 4], [0, 3], [0, 5])
    jobs = [
        make(0, [first, second, third], lam="0.4", seed="0"),
        make(1, [second, third, fourth], lam="0.4", seed="1"),
        make(2, [first, second, third], lam="0", seed="0"),
        make(3, [first, second, third], lam="0", seed="0"),
    ]
    write_whole(tmp_path, jobs)
    [(_, curves, _)] = drawn
    assert [curve.scores.tolist() for curve in curves] == [
        [first, second, third, fourth],
        [first, second, third],
    ]
    out, err = capsys.readouterr()
    for scores in ([1, 4, 3, 5], [1, 4, 3]):
        mean, error = np.mean(scores), stats.sem(scores)
        low, high = np.clip(stats.t.interval(0.95, len(scores) - 1, mean, error), 0, 5)
        assert f"{len(scores)}    │ {mean:.2f}, 95 % interval {low:.2f} to {high:.2f}" in out
    assert err == (
        "5 of 12 runs repeat a run of an earlier job, with the same configuration and seed; "
        "they count once\n"
    )
    found = [(row["job"], row["seed"]) for row in rows(tmp_path / "evaluations.csv")[::2]]
    assert found == [("0", "0"), ("0", "1"), ("0", "2"), ("1", "3"), *(("2", i) for i in "012")]


def test_a_later_launch_has_a_table_of_its_own(
    make: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A configuration that the launch repeats with other seeds is in it, with all its runs."""
    jobs = [
        make(0, [[0, 1]], lam="0", seed="0"),
        make(1, [[0, 3]], lam="0.4", seed="0"),
        make(2, [[0, 5]], lam="0.4", seed="7"),
        make(3, [[0, 2]], lam="1", seed="0"),
    ]
    write_whole(tmp_path, jobs, first=2)
    out = capsys.readouterr().out
    body = [line for line in out.splitlines() if line.startswith("│")]
    assert [line[:14].strip("│ ") for line in body] == ["λ = 0.4", "λ = 1"]
    assert "2    │ 4.00" in body[0]


def test_unfinished_jobs_are_told_and_not_counted(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    write_whole(tmp_path, [make(0, None, lam="0.1"), make(1, [[0, 2]], lam="0.3")])
    first, second = rows(tmp_path / "summary.csv")
    assert set(first.values()) == {"0", "0.1", ""}
    assert second["mean_score"] == "2.0"
    assert {row["job"] for row in rows(tmp_path / "evaluations.csv")} == {"1"}
    assert len(drawn[0][1]) == 1


def test_nothing_finished_has_no_curves(
    make: Make, tmp_path: Path, drawn: list[tuple[str, list[Curve], Score]]
) -> None:
    write_whole(tmp_path, [make(0, None, lam="0.1"), make(1, None, lam="0.3")])
    assert len(rows(tmp_path / "summary.csv")) == 2
    assert not (tmp_path / "evaluations.csv").exists()
    assert not drawn


def test_the_table_is_printed_the_best_first(
    make: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    jobs = [make(i, [[0, i % 6]], alpha=f"0.{i + 10}", seed="0") for i in range(22)]
    write_whole(tmp_path, jobs)
    lines = capsys.readouterr().out.splitlines()
    body = [line for line in lines if line.startswith("│")]
    assert len(body) == 20
    assert "α = 0.15" in body[0]
    assert "5.00, one run, so no interval" in body[0]
    assert any("best 20 of 22" in line for line in lines)
    assert (tmp_path / "learning_curves.png").stat().st_size > 0


def test_scores_of_different_measures_have_a_picture_and_a_table_each(
    make: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    jobs = [make(0, [[0, 1], [0, 3]], env="a"), make(1, [[0, 2], [0, 2]], env="b")]
    write_whole(tmp_path, jobs[:1])
    assert [path.name for path in tmp_path.glob("*.png")] == ["learning_curves.png"]
    jobs[1] = replace(jobs[1], score=Score("return", -1, 1))
    write_whole(tmp_path, jobs)
    assert {path.name for path in tmp_path.glob("*.png")} == {
        "learning_curves_catches.png",
        "learning_curves_return.png",
    }
    tables = capsys.readouterr().out.split("configuration")[2:]
    assert "2.00, 95 % interval 0.00 to 5.00" in tables[0]
    assert "0.00, 95 % interval 0.00 to 0.00" in tables[1]
