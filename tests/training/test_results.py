import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fnnq_torchrl.training.results import (
    PARAMETERS,
    Evaluations,
    Outcome,
    read_evaluations,
    summarise,
    write_evaluations,
    write_summary,
)

TWO_RUNS = Outcome(
    seed=np.array([3, 4]),
    lam=np.array([0.2, 0.1]),
    situations=np.array([0, 5, 10]),
    steps=np.array([[0, 310, 600], [0, 280, 450]]),
    catches=np.array([[1, 2, 4], [0, 5, 5]]),
    diverged=np.array([[False, False, False], [False, False, True]]),
    returns=np.array([[-0.2, 0.1, 0.7], [-0.5, 1.0, -0.5]]),
    lengths=np.array([[120.0, 99.5, 60.2], [120.0, 50.0, 120.0]]),
    alpha=np.array([[0.4, 0.396, 0.39], [0.4, 0.3, 0.2]]),
    gamma=np.full((2, 3), 0.95),
    batch_runs=4,
    batch_learning_steps=2100,
    train_seconds=0.5,
    compile_seconds=0.25,
    evaluate_seconds=0.125,
)
TWO_RUNS_CSV = """\
seed,lam,situations,steps,catches,diverged,return,length,alpha,temperature,gamma
3,0.2,0,0,1,0,-0.2,120.0,0.4,nan,0.95
3,0.2,5,310,2,0,0.1,99.5,0.396,nan,0.95
3,0.2,10,600,4,0,0.7,60.2,0.39,nan,0.95
4,0.1,0,0,0,0,-0.5,120.0,0.4,nan,0.95
4,0.1,5,280,5,0,1.0,50.0,0.3,nan,0.95
4,0.1,10,450,5,1,-0.5,120.0,0.2,nan,0.95
"""
SINGLE_RUN = TWO_RUNS.of(slice(0, 1))


@st.composite
def any_evaluations(draw: st.DrawFn) -> Evaluations:
    runs, evaluations = draw(st.integers(1, 4)), draw(st.integers(2, 5))
    rising = draw(
        st.lists(st.integers(1, 1000), min_size=evaluations - 1, max_size=evaluations - 1)
    )
    counts = st.integers(0, 2**62)
    return Evaluations(
        seed=draw(hnp.arrays(np.int64, runs)),
        lam=draw(hnp.arrays(np.float64, runs, elements=st.floats(allow_nan=False))),
        situations=np.cumsum([0, *rising]),
        steps=draw(hnp.arrays(np.int64, (runs, evaluations), elements=counts)),
        catches=draw(hnp.arrays(np.int64, (runs, evaluations), elements=counts)),
        diverged=draw(hnp.arrays(np.bool_, (runs, evaluations))),
        returns=draw(hnp.arrays(np.float64, (runs, evaluations))),
        lengths=draw(hnp.arrays(np.float64, (runs, evaluations))),
        **draw(
            st.fixed_dictionaries(
                {}, optional=dict.fromkeys(PARAMETERS, hnp.arrays(np.float64, (runs, evaluations)))
            )
        ),
    )


def test_the_file_is_as_promised(tmp_path: Path) -> None:
    write_evaluations(tmp_path / "evaluations.csv", TWO_RUNS)
    assert (tmp_path / "evaluations.csv").read_text() == TWO_RUNS_CSV


@given(written=any_evaluations())
def test_reading_back_is_exact(
    tmp_path_factory: pytest.TempPathFactory, written: Evaluations
) -> None:
    path = tmp_path_factory.mktemp("results") / "evaluations.csv"
    write_evaluations(path, written)
    read = read_evaluations(path)
    for column in fields(Evaluations):
        one, other = getattr(read, column.name), getattr(written, column.name)
        np.testing.assert_array_equal(one, other, strict=True)


def test_further_columns_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    header, *rows = TWO_RUNS_CSV.splitlines()
    path.write_text("\n".join([f"{header},trace", *(f"{row},output" for row in rows)]) + "\n")
    np.testing.assert_array_equal(read_evaluations(path).catches, TWO_RUNS.catches)


def test_an_older_file_has_no_learning_parameters(tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    rows = [row.rsplit(",", len(PARAMETERS))[0] for row in TWO_RUNS_CSV.splitlines()]
    path.write_text("\n".join(rows) + "\n")
    read = read_evaluations(path)
    np.testing.assert_array_equal(read.returns, TWO_RUNS.returns)
    assert all(np.isnan(getattr(read, name)).all() for name in PARAMETERS)


def test_a_file_cut_anywhere_is_refused_unless_whole_runs_are_left(tmp_path: Path) -> None:
    path = tmp_path / "evaluations.csv"
    first_run = TWO_RUNS_CSV.index("4,0.1,0,0,0")
    # If only the first run is left, missing last rows look like a shorter run.
    readable = {first_run, TWO_RUNS_CSV.index("3,0.2,10,600,4,0,0")}
    for length in range(len(TWO_RUNS_CSV)):
        path.write_text(TWO_RUNS_CSV[:length])
        if length in readable:
            assert read_evaluations(path).runs == 1
        else:
            with pytest.raises(ValueError, match="not a complete evaluations file"):
                read_evaluations(path)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("seed,lam", "lam,seed", "its first columns must be seed,lam,situations,steps,catches"),
        ("3,0.2,5,310,2", "9,0.2,5,310,2", "seed changes within a run"),
        ("3,0.2,5,310,2", "3,0.3,5,310,2", "lam changes within a run"),
        ("3,0.2,5,310,2,0,0.1,99.5,0.396,nan,0.95\n", "", "a run lacks"),
        ("4,0.1,5", "4,0.1,6", "not all evaluated after the same situations"),
        ("4,0.1,5", "4,0.1,10", "not all evaluated after the same situations"),
        ("4,0.1,0,0,0,0,-0.5,120.0,0.4,nan,0.95\n", "", "seed changes within a run"),
        ("310,2", "310", "column"),
        ("310", "31x", "could not convert"),
        ("310", "3.5", "could not convert"),
        ("310", "99999999999999999999", "could not convert"),
        ("310", "", "could not convert"),
        ("310,2", "310,2#", "could not convert"),
    ],
)
def test_a_damaged_file_is_refused_with_its_name_and_the_reason(
    tmp_path: Path, old: str, new: str, reason: str
) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_text(TWO_RUNS_CSV.replace(old, new, 1))
    with pytest.raises(ValueError, match=reason) as caught:
        read_evaluations(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"\n", b"\x89PNG\r\n\x1a\n\xff", b"a,b\n1,2\n"])
def test_a_foreign_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "evaluations.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="not a complete evaluations file"):
        read_evaluations(path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"seed": np.array([3.0, 4.0])}, "seed must be int64"),
        ({"lam": np.array([0.2])}, "lam must be float64"),
        ({"steps": TWO_RUNS.steps.T}, "steps must be int64"),
        ({"catches": TWO_RUNS.catches.astype(np.int32)}, "catches must be int64"),
        ({"situations": np.array([5, 10, 15])}, "situations must begin at 0"),
        ({"situations": np.array([0, 10, 5])}, "begin at 0 and rise, over at least two"),
    ],
)
def test_wrong_arrays_are_refused(change: dict[str, np.ndarray], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        replace(TWO_RUNS, **change)


def test_scores_leave_out_the_evaluation_before_learning() -> None:
    assert TWO_RUNS.runs == 2
    assert TWO_RUNS.learning_steps == 600 + 450
    np.testing.assert_array_equal(TWO_RUNS.mean_score, [3.0, 5.0])
    np.testing.assert_array_equal(TWO_RUNS.final_score, [3.0, 5.0])


def test_the_final_score_is_over_the_last_eight_evaluations() -> None:
    catches = np.array([[5, 5, 5, *[1, 2] * 4]])
    outcome = replace(
        SINGLE_RUN,
        situations=np.arange(0, 55, 5),
        steps=catches,
        catches=catches,
        diverged=catches < 0,
        returns=catches * 1.0,
        lengths=catches * 1.0,
        **dict.fromkeys(PARAMETERS, catches * 1.0),
    )
    assert outcome.final_score == [1.5]
    assert outcome.mean_score == [2.2]


def test_summary_by_hand(tmp_path: Path) -> None:
    summary = summarise(TWO_RUNS)
    # Scores 3 and 5: mean 4, standard error 1, t(0.975, 1) = 12.7062.
    interval = pytest.approx([4 - 12.7062, 4 + 12.7062], abs=1e-4)
    expected = {
        "runs": 2,
        "diverged_runs": 1,
        "lam": [0.1, 0.2],
        "learning_steps": 1050,
        "batch_runs": 4,
        "train_seconds": 0.5,
        "compile_seconds": 0.25,
        "evaluate_seconds": 0.125,
        "learning_steps_per_second": 4200.0,
        "measure": "successes",
        "mean_score": 4.0,
        "mean_score_interval": interval,
        "final_score": 4.0,
        "final_score_interval": interval,
        "confidence": 0.95,
    }
    write_summary(tmp_path / "summary.json", summary)
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written == expected
    assert list(written) == list(expected)


def test_what_a_single_run_has_no_number_for_is_null() -> None:
    summary = summarise(replace(SINGLE_RUN, train_seconds=0.0))
    assert summary["mean_score"] == 3.0
    assert summary["mean_score_interval"] is None
    assert summary["final_score_interval"] is None
    assert summary["learning_steps_per_second"] is None


def test_a_summary_with_nan_is_refused(tmp_path: Path) -> None:
    summary = summarise(replace(TWO_RUNS, train_seconds=float("nan")))
    with pytest.raises(ValueError, match="JSON"):
        write_summary(tmp_path / "summary.json", summary)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("measure", "scores"), [("return", [0.4, 0.25]), ("length", [79.85, 85])])
def test_the_score_is_of_the_worlds_measure(measure: str, scores: list[float]) -> None:
    outcome = replace(TWO_RUNS, measure=measure)
    np.testing.assert_allclose(outcome.mean_score, scores)
    assert summarise(outcome)["measure"] == measure
