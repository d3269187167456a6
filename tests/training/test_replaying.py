"""A controller takes the same actions on a recorded log as in its world."""

import csv
import sys
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl import best_seed, load_policy
from fnnq_torchrl.replay import main
from fnnq_torchrl.studies.rules.job import choose, read_job
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations
from tests.compositions import config_of


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("job")
    run_job(config_of("situations=5", "num_seeds=2", "env.time_limit_steps=60"), directory)
    return directory


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", ["replay", *words])
    main()


def test_it_writes_the_policys_actions(
    job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bearings = [-0.7, -0.1, 0.02, 0.4]
    log = tmp_path / "drive.csv"
    log.write_text("time,bearing\n" + "".join(f"{i},{b}\n" for i, b in enumerate(bearings)))
    run(monkeypatch, f"log={log}", f"run={job}", "seed=1")
    rows = [*csv.DictReader((tmp_path / "drive-actions.csv").read_text().splitlines())]
    assert [*rows[0]] == ["time", "bearing", "action", "left_mps", "right_mps"]
    policy = load_policy(job, seed=1)
    for row, bearing in zip(rows, bearings, strict=True):
        state = {"bearing": torch.tensor([[bearing]]), "chance": torch.zeros(1, 1)}
        action = policy(TensorDict(state, [1]))["action"].item()
        assert float(row["action"]) == pytest.approx(action)
        assert float(row["left_mps"]) == pytest.approx(0.3 * (1 + action))
        assert float(row["right_mps"]) == pytest.approx(0.3 * (1 - action))
        assert float(row["bearing"]) == bearing


def test_the_best_run_drives_as_it_is_exported(
    job: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "drive.csv"
    log.write_text("\ufeffbearing\n0.1\n-0.3\n", encoding="utf-8")  # as spreadsheets write it
    best = choose(read_job(job), "best").seed
    scores = read_evaluations(job / "evaluations.csv").final_score
    assert best_seed(job) == best
    assert scores[best] == max(scores)
    texts = []
    for words in ((), (f"seed={best}",), (f"seed={1 - best}",)):
        run(monkeypatch, f"log={log}", f"run={job}", *words)
        texts.append((tmp_path / "drive-actions.csv").read_text())
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize(
    ("text", "words", "line"),
    [
        ("time,bering\n1,2\n", (), "there is no column bearing; the controller needs bearing"),
        ("bearing\n0.1\nx\n", (), "line 3: bearing=x: must be a finite number"),
        ("bearing\ninf\n", (), "line 2: bearing=inf: must be a finite number"),
        ("bearing\n", (), "there is no row"),
        ("bearing\n1\n", ("seed=9",), "has no run with seed=9; it has 0 to 1"),
        ("bearing\n1\n", ("runs=9",), "runs=9: there is no runs; did you mean run?"),
    ],
)
def test_mistakes_are_told_in_one_line(
    job: Path,
    tmp_path: Path,
    text: str,
    words: tuple[str, ...],
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = tmp_path / "drive.csv"
    log.write_text(text)
    with pytest.raises(SystemExit) as ended:
        run(monkeypatch, f"log={log}", f"run={job}", *words)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert line in told
    assert not (tmp_path / "drive-actions.csv").exists()
