"""The commands that print, draw and export the rules of a finished job."""

import csv
import io
import json
import sys
import warnings
from pathlib import Path

import pytest
import torch
from matplotlib import rc_context
from matplotlib.patches import Rectangle

from fnnq_torchrl import RuleBase, load_rules, plot, rules
from fnnq_torchrl.studies.rules import pictures, plot_command
from fnnq_torchrl.studies.rules.job import choose, read_job
from fnnq_torchrl.studies.rules.page import BEGIN, END, write_faithfulness
from fnnq_torchrl.studies.rules.reading import read_run
from fnnq_torchrl.studies.rules.replay import greedy, replay
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.weights import load_checkpoint
from tests.compositions import config_of
from tests.programs import SMALL_WORLD

CONFIG = config_of(
    "situations=20", "num_seeds=3", "engine=eager", "checkpoint.snapshots=true", *SMALL_WORLD
)


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("job")
    run_job(CONFIG, path)
    return path


def run(command: object, monkeypatch: pytest.MonkeyPatch, *words: object) -> int | str | None:
    monkeypatch.setattr(sys, "argv", ["rules", *map(str, words)])
    try:
        command.main()  # type: ignore[attr-defined]
    except SystemExit as end:
        return end.code
    return 0


def test_a_replay_is_the_last_evaluation_again(directory: Path) -> None:
    job = read_job(directory)
    played = replay(job, job.seeds, job.weights, lambda each: greedy(job, each))
    last = read_evaluations(directory / "evaluations.csv")
    assert played.successes.tolist() == last.catches[:, -1].tolist()
    assert played.counts.sum(0).double().mean(-1).tolist() == last.lengths[:, -1].tolist()


def test_a_reading(directory: Path) -> None:
    job = read_job(directory)
    reading = read_run(job, choose(job, "1"))
    weights = load_checkpoint(directory / "checkpoint.pt").weights["weight"]
    assert torch.equal(reading.chosen.rules.consequents, weights[1].double())
    [fired] = reading.fired
    assert fired.sum().item() == pytest.approx(reading.steps)
    states, actions = reading.played.visited()
    assert torch.allclose(reading.chosen.rules.greedy(states), actions)
    mean = choose(job, "mean")
    torch.testing.assert_close(mean.rules.consequents, weights.double().mean(0))
    torch.testing.assert_close(load_rules(directory).consequents, mean.rules.consequents)
    assert str(load_rules(directory, 1)) == str(reading.chosen.rules)


@pytest.mark.parametrize(
    ("keys", "seed", "words"),
    [
        (
            ("task=wander", "value=fnnq_sum", "env.time_limit_steps=10"),
            "mean",
            ["Q is the sum of", "The consequents of sonar_left_m and their spread", "± 0."],
        ),
        (
            ("value.learn_memberships=true", "rules.count_firing=true", *SMALL_WORLD),
            "1",
            ["The labels that this run has learned", "centre before"],
        ),
    ],
)
def test_sums_and_learned_labels(
    keys: tuple[str, ...],
    seed: str,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    few = ("situations=5", "num_seeds=2", "engine=eager", "checkpoint.snapshots=true")
    run_job(config_of(*few, *keys), tmp_path)
    capsys.readouterr()
    job = read_job(tmp_path)
    played = replay(job, job.seeds, job.weights, lambda each: greedy(job, each))
    last = read_evaluations(tmp_path / "evaluations.csv")
    assert played.returns.tolist() == pytest.approx(last.returns[:, -1].tolist(), rel=1e-5)
    which = (f"run={tmp_path}", f"seed={seed}")
    told = {}
    for form in ("text", "csv"):
        assert run(rules, monkeypatch, *which, f"format={form}") == 0
        told[form] = capsys.readouterr().out
    for each in words:
        assert each in told["text"]
    reading = read_run(job, choose(job, seed))
    total = sum(float(each.sum()) for each in reading.fired)
    assert total == pytest.approx(reading.steps * len(reading.fired))
    table = [row for row in csv.DictReader(io.StringIO(told["csv"])) if row["what"] == "rule"]
    assert len(table) == sum(part.consequents.numel() for part in reading.chosen.parts)
    for row in table:
        trained = float(row.get("fired_while_learning", row["fired"]))
        assert row["hardly_trained"] == str(trained < 1)
    (tmp_path / "p").mkdir()
    monkeypatch.setattr(plot_command, "save", lambda figure, picture: picture.touch())
    assert run(plot, monkeypatch, *which, f"to={tmp_path / 'p'}") == 0
    assert len([*(tmp_path / "p").iterdir()]) == 4
    assert run(rules, monkeypatch, *which, f"export={tmp_path / 'q.json'}") == 0
    if seed != "mean":
        again = RuleBase.read(tmp_path / "q.json")
        assert again.inputs == load_rules(tmp_path, int(seed)).inputs
        assert run(rules, monkeypatch, f"run={tmp_path}", "seed=mean") == 2
        assert "name one run" in capsys.readouterr().err


def test_an_episode_among_obstacles_has_a_path_and_room_for_long_premises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = config_of(
        "task=follow_obstacles",
        "situations=5",
        "evaluation.every=5",
        "env.time_limit_steps=3",
        "engine=eager",
    )
    run_job(config, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run(plot, monkeypatch, f"run={tmp_path}") == 0
    job = read_job(tmp_path)
    figure = pictures.episode(read_run(job, choose(job, "best")), 0)
    path, strengths, _ = figure.get_axes()
    grey = [patch for patch in path.patches if patch.get_facecolor()[:3] == (0.65, 0.65, 0.65)]
    assert len(grey) == 3  # the obstacles
    assert (-3, -3) in [each.get_xy() for each in path.patches if isinstance(each, Rectangle)]
    starts = [line.get_xydata()[0].tolist() for line in path.lines if len(line.get_xydata()) == 4]
    assert [0, 0] in starts  # the robot's way
    assert strengths.get_position().width > 0.5  # the legend leaves it its width


def test_printed(
    directory: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {}
    for form in ("text", "markdown", "csv", "json"):
        assert run(rules, monkeypatch, f"run={directory}", "seed=1", f"format={form}") == 0
        said[form] = capsys.readouterr().out
    expected = load_rules(directory, 1).table()
    every = [*csv.DictReader(io.StringIO(said["csv"]))]
    table = [row for row in every if row["what"] == "rule"]
    assert [(row["bearing"], row["steer"]) for row in table] == [
        (row["bearing"], row["steer"]) for row in expected
    ]
    assert [float(row["value"]) for row in table] == [row["value"] for row in expected]
    assert [row["value"] for row in json.loads(said["json"])["rules"]] == [
        row["value"] for row in expected
    ]
    controller = load_rules(directory, 1).controller()
    switches = [float(row["bearing"]) for row in every if row["what"] == "switch"]
    assert switches == [switch.low for switch in controller.switches]
    places = ", ".join(f"{switch.low:+.4f}" for switch in controller.switches) or "none"
    assert f"\nSwitching points of bearing: {places}\n" in said["text"]
    stretches = [row for row in every if row["what"] == "best action"]
    assert [float(row["steer"]) for row in stretches] == [
        stretch.action for stretch in controller.stretches
    ]
    distilled = [float(row["steer"]) for row in every if row["what"] == "distilled"]
    assert distilled == controller.distilled.consequents.tolist()
    first = (
        f"if bearing is far_right and steer is hard_left then value is {expected[0]['value']:.3f}"
    )
    assert f"\n  {first}" in said["text"]
    assert f"\n* {first}" in said["markdown"]
    assert "| bearing \\ steer | hard_left | left | right | hard_right |" in said["markdown"]


def test_explained_exported_and_recorded(
    directory: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = (f"run={directory}", "seed=0", "explain.bearing=0.3", f"picture={tmp_path / 'e.png'}")
    assert run(rules, monkeypatch, *words) == 0
    assert capsys.readouterr().out.startswith("bearing = 0.3: steer ")
    assert (tmp_path / "e.png").stat().st_size > 0
    (directory / "explanation.png").mkdir()  # the default picture can't be written there
    assert run(rules, monkeypatch, *words[:-1]) == 0
    shown = capsys.readouterr()
    assert shown.out.startswith("bearing = 0.3: steer ")
    assert shown.err.startswith(f"going on without {directory / 'explanation.png'}")
    words = (f"run={directory}", "seed=0", f"export={tmp_path / 'q.fll'}")
    assert run(rules, monkeypatch, *words, f"record={tmp_path / 'd.csv'}") == 0
    again = RuleBase.read(tmp_path / "q.fll")
    assert torch.equal(again.consequents, load_rules(directory, 0).consequents)
    rows = [*csv.DictReader(io.StringIO((tmp_path / "d.csv").read_text()))]
    assert [*rows[0]] == ["bearing", "steer"]
    states = torch.tensor([[float(row["bearing"])] for row in rows]).double()
    actions = torch.tensor([float(row["steer"]) for row in rows]).double()
    assert torch.allclose(load_rules(directory, 0).greedy(states), actions)


def test_drawn(directory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = (f"run={directory}", f"to={tmp_path}", "situation=2", "format=svg")
    with rc_context({"text.usetex": True}):  # a user's setting, which fails without LaTeX
        assert run(plot, monkeypatch, *words) == 0
    drawn = {path.stem: path.read_text() for path in tmp_path.iterdir()}
    assert set(drawn) == {"memberships", "surface", "consequents", "episode"}


@pytest.mark.parametrize(
    ("command", "words", "said"),
    [
        (rules, ["sed=1"], "sed=1: there is no sed; did you mean seed?"),
        (rules, [], "run=DIR is missing, the directory of a finished job"),
        (rules, ["run=nowhere"], "nowhere: there is no such directory"),
        (rules, ["run={}", "seed=9"], "seed=9: must be best, mean or one of 0 to 2"),
        (rules, ["run={}", "format=tex"], "format='tex': did you mean text?"),
        (rules, ["run={}", "explain.bearing=x"], "explain.bearing='x': must be a finite number"),
        (rules, ["run={}", "controller=full"], "controller=full: needs export=FILE"),
        (rules, ["run={}", "export=q.xml"], "q.xml: can't be written by its ending; expected .fll"),
        (plot, ["run={}", "situation=6"], "situation='6': must be a whole number from 1 to 5"),
    ],
)
def test_mistakes_are_one_line(
    command: object,
    words: list[str],
    said: str,
    directory: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    code = run(command, monkeypatch, *(word.format(directory) for word in words))
    line = capsys.readouterr().err if code == 2 else str(code)
    assert line.startswith(said)
    assert "\n" not in line.strip()


def test_the_page(directory: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}old\n{END}after\n")
    write_faithfulness(read_job(directory), page)
    text = page.read_text()
    assert text.startswith(f"before\n{BEGIN}Over 3 seeds, ")
    assert text.endswith(f"{END}after\n")
    mean = read_evaluations(directory / "evaluations.csv").catches[:, -1].mean()
    assert f"| best action | {mean:.2f}" in text
    assert "](figures/rules.png)\n\nThe picture shows Q of seed " in text
    assert (tmp_path / "figures" / "rules.png").stat().st_size > 0
    page.write_text("no marks")
    with pytest.raises(ValueError, match="has no lines"):
        write_faithfulness(read_job(directory), page)
