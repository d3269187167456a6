"""The table of results, and the frame in Python."""

import builtins
import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fnnq_torchrl import load_results, results
from fnnq_torchrl.studies.results.collect import collect, job_directories
from fnnq_torchrl.studies.results.frame import load_results as in_its_room
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.results import read_evaluations
from tests.experiment_files import grid, write_experiment

RUNS = 3


@pytest.fixture
def outputs(tmp_path: Path) -> Path:
    """Write a sweep over λ and a second one, of which one job repeats and one is new."""
    root = tmp_path / "outputs"
    for sweep, lams in (("first", "0,0.2"), ("second", "0.2,0.8")):
        jobs = grid({"lam": lams}, "situations=10")
        write_experiment(root / sweep, jobs, lambda settings: 4 - settings["lam"], runs=RUNS)
    return root


def told(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[str, str, object]:
    """Run the command; return its output, its complaints and its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["results", *map(str, words)])
        patch.setenv("COLUMNS", "100")
        status: object = 0
        try:
            results.main()
        except SystemExit as end:
            status = end.code
    captured = capsys.readouterr()
    return captured.out, captured.err, status


def test_a_run_that_repeats_across_jobs_counts_once(
    outputs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err, status = told(capsys, outputs, "format=csv")
    rows = [*csv.DictReader(out.splitlines())]
    assert status == 0
    assert [float(row["lam"]) for row in rows] == [0, 0.2, 0.8]
    assert [row["runs"] for row in rows] == ["3", "3", "3"]
    assert rows[1]["jobs"] == f"{outputs / 'first' / '1'} {outputs / 'second' / '0'}"
    assert err.startswith("3 runs repeat a run of an earlier job")
    evaluations = read_evaluations(outputs / "first" / "1" / "evaluations.csv")
    expected = mean_interval(evaluations.final_score, bounds=(0, 5))
    shown = [float(rows[1][f"final_score{end}"]) for end in ("", "_low", "_high")]
    assert shown == pytest.approx([float(number) for number in expected])


def test_more_seeds_of_a_configuration_join_its_runs(outputs: Path) -> None:
    path = outputs / "second" / "1" / ".hydra" / "config.yaml"
    settings = json.loads(path.read_text())
    later = settings | {"lam": 0.0, "seed": 2}  # of the seeds 2, 3 and 4, 2 is there
    path.write_text(json.dumps(later))
    rows = (outputs / "second" / "1" / "evaluations.csv").read_text().splitlines(keepends=True)
    moved = [f"{int(row.partition(',')[0]) + 2},{row.partition(',')[2]}" for row in rows[1:]]
    (outputs / "second" / "1" / "evaluations.csv").write_text(rows[0] + "".join(moved))
    found = collect([outputs])
    assert found.varied == ["lam"]
    assert found.configurations[0].evaluations.seed.tolist() == [0, 1, 2, 3, 4]
    assert found.repeated == RUNS + 1


def test_keys_of_one_kind_only_are_left_out(tmp_path: Path) -> None:
    jobs = [("situations=10",), ("value=mlp", "situations=10")]
    write_experiment(tmp_path, jobs, lambda settings: 3, runs=2)
    found = collect([tmp_path])
    assert "value.kind" in found.varied
    assert not {"value.width", "value.widths", "seed", "num_seeds"} & {*found.varied}
    assert [found.label(each).split(", ")[-1] for each in found.configurations] == ["fnnq", "mlp"]


def test_jobs_without_results_are_told_in_a_line_each(
    outputs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (outputs / "first" / "0" / "summary.json").unlink()
    damaged = outputs / "second" / "1" / "evaluations.csv"
    damaged.write_text(damaged.read_text()[:-3])
    (outputs / "second" / "0" / ".hydra" / "config.yaml").write_text("lam: [")
    out, err, status = told(capsys, outputs, "format=markdown")
    lines = err.splitlines()
    assert (len(lines), status, len(out.splitlines())) == (3, 0, 3)
    assert lines[0] == f"left out: {outputs / 'first' / '0'}: hasn't finished"
    assert "config.yaml is not a configuration" in lines[1]
    assert "is not a complete evaluations file" in lines[2]


def test_runs_that_the_configuration_does_not_have_are_refused(outputs: Path) -> None:
    path = outputs / "first" / "0" / ".hydra" / "config.yaml"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"num_seeds": 10**12}))
    assert "other runs than the configuration" in collect([outputs]).left_out[0]


def test_a_name_does_not_control_the_terminal(
    outputs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (outputs / "first").rename(outputs / "\x1b[2J")
    (outputs / "\x1b[2J" / "0").rename(outputs / "\x1b[2J" / "[red]\x1b[31m|")
    for form in ("table", "markdown"):
        out, err, _ = told(capsys, outputs, f"format={form}")
        assert "\x1b" not in out + err
        assert "[red]" in out
    (outputs / "\x1b[2J" / "1" / "summary.json").unlink()
    assert "\x1b" not in told(capsys, outputs)[1]


def test_the_table_has_the_differing_keys_and_intervals(
    outputs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, _, _ = told(capsys, outputs / "first")
    assert [word in out for word in ("λ", "runs", "mean score", "final score")] == [True] * 4
    assert out.count("[") == 4
    assert "diverged" not in out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["nowhere"], "nowhere: there is no such directory"),
        (["{}/first/0/.hydra"], "has no jobs; a job has a file .hydra/config.yaml"),
        (["{}", "format=cvs"], "format=cvs: must be table or markdown or csv; did you mean csv?"),
        (["{}", "own=maybe"], "own=maybe: must be true or false"),
        (["formt=csv"], "did you mean format?"),
    ],
)
def test_a_mistake_is_one_line(
    words: list[str], line: str, outputs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err, status = told(capsys, *(word.format(outputs) for word in words))
    message = err + (status if isinstance(status, str) else "")
    assert (out, message.strip().count("\n")) == ("", 0)
    assert line in message
    assert status != 0


def test_jobs_are_found_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    jobs = grid({"lam": ",".join(f"{i / 20:g}" for i in range(12))}, "situations=5")
    write_experiment(tmp_path, jobs, lambda settings: 3, runs=1)
    assert [path.name for path in job_directories([tmp_path])] == [*map(str, range(12))]


def test_the_frame_has_a_row_for_each_run(outputs: Path) -> None:
    pytest.importorskip("pandas")
    frame = load_results(outputs)
    assert [*frame.columns[:4]] == ["job", "lam", "seed", "diverged"]
    assert len(frame) == 3 * RUNS
    assert frame.groupby("lam").size().to_dict() == {0: RUNS, 0.2: RUNS, 0.8: RUNS}
    evaluations = read_evaluations(outputs / "second" / "1" / "evaluations.csv")
    mine = frame[frame.job == str(outputs / "second" / "1")]
    assert mine.mean_score.tolist() == evaluations.mean_score.tolist()


def test_the_frame_has_a_row_for_each_evaluation(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    jobs = grid({"situations": "10,20"}, "evaluation.every=5")
    write_experiment(tmp_path, jobs, lambda settings: 4, runs=RUNS)
    frame = load_results(tmp_path, evaluations=True)
    assert len(frame) == RUNS * (3 + 5)
    assert sorted(frame["config.situations"].unique()) == [10, 20]
    evaluations = read_evaluations(tmp_path / "1" / "evaluations.csv")
    for run in range(RUNS):
        mine = frame[(frame["config.situations"] == 20) & (frame.seed == run)]
        np.testing.assert_array_equal(mine.situations, evaluations.situations)
        np.testing.assert_array_equal(mine.score, evaluations.catches[run])


def test_without_pandas_a_line_says_what_to_install(
    outputs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = builtins.__import__

    def lacking(name: str, *others: Any) -> Any:
        if name == "pandas":
            raise ModuleNotFoundError(name)
        return usual(name, *others)

    monkeypatch.setattr(builtins, "__import__", lacking)
    module = sys.modules[in_its_room.__module__]
    monkeypatch.setattr(module, "installing", lambda extra: f"pip install {extra}>=2")
    with pytest.raises(ModuleNotFoundError, match=r"^load_results needs pandas; pip install pan"):
        load_results(outputs)
