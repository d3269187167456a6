"""The report's page, read without a browser; tests/browser opens it in one."""

import base64
import csv
import hashlib
import json
import re
import shutil
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from envs.shapes import INKS
from fnnq_torchrl import load_rules, report
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.studies.report import charts, page
from fnnq_torchrl.studies.report.making import command_of
from fnnq_torchrl.studies.reproduction.markdown import interval_words
from fnnq_torchrl.studies.results.collect import collect
from fnnq_torchrl.studies.statistics import paired_difference
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.results import read_evaluations
from tests.experiment_files import grid, write_experiment
from tests.job_files import train_job
from tests.programs import SMALL_WORLD

FEW = ("situations=10", "engine=eager", "evaluation.every=5")
SMALL = (*FEW, "num_seeds=2")
EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(1)>"


@pytest.fixture(scope="module", autouse=True)
def no_libraries() -> Iterator[None]:
    """Leave out the charts' libraries, whose packing takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "libraries", lambda: "// Vega")
        yield


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("jobs") / "job"
    return train_job(directory, *SMALL, *SMALL_WORLD, "checkpoint.snapshots=true")


@pytest.fixture
def copy(job: Path, tmp_path: Path) -> Path:
    """Return a copy of the job, to be damaged."""
    return Path(shutil.copytree(job, tmp_path / "copy"))


def text_of(directory: Path) -> str:
    return page.make_report(directory, collect([directory]))


@pytest.fixture(scope="module")
def text(job: Path) -> str:
    return text_of(job)


def data_of(text: str) -> dict[str, Any]:
    (found,) = re.findall(r'id="data">(.*?)</script>', text, re.DOTALL)
    data: dict[str, Any] = json.loads(found)
    return data


def values_of(text: str, title: str, layer: int = -1) -> list[dict[str, Any]]:
    """Return the data of the chart with this title."""
    (number,) = re.findall(rf"<figcaption>{title}.*?data-chart=\"(\d+)\"", text, re.DOTALL)[:1]
    spec = data_of(text)["charts"][int(number)]
    data: list[dict[str, Any]] = (spec if layer < 0 else spec["layer"][layer])["data"]["values"]
    return data


class Elements(HTMLParser):
    """The elements of a page with their attributes, and the text of each script."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.inside = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self.scripts += [""] * (tag == "script")
        self.inside = tag == "script"

    def handle_endtag(self, tag: str) -> None:
        self.inside = False

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.scripts[-1] += data


def test_it_needs_no_other_file_and_allows_no_other_script(text: str) -> None:
    elements = Elements(text)
    for tag, attributes in elements.found:
        assert "src" not in attributes
        assert (attributes.get("href") or "#").startswith("#"), tag
    assert not re.search(r"https?://|@import|url\(", text)
    (policy,) = [item["content"] or "" for _, item in elements.found if "http-equiv" in item]
    hashes = re.findall(r"'sha256-(.*?)'", policy)
    ours = [hashlib.sha256(script.encode()).digest() for script in elements.scripts[1:]]
    assert hashes == [base64.b64encode(each).decode() for each in ours]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert len(text) < 1e6  # without the libraries, which have another million


def test_the_learning_curve_has_the_means_and_their_intervals(text: str, job: Path) -> None:
    evaluations = read_evaluations(job / "evaluations.csv")
    mean, low, high = mean_interval(evaluations.score, bounds=(0, 5))
    values = values_of(text, "Learning curves")
    assert [value["x"] for value in values] == evaluations.situations.tolist()
    for key, numbers in (("y", mean), ("low", low), ("high", high)):
        assert [value[key] for value in values] == pytest.approx(numbers.tolist(), abs=1e-3)


def test_the_replay_is_the_last_test_of_the_best_run(text: str, job: Path) -> None:
    seed = int(re.findall(r"the run with seed (\d+)", text)[0])
    evaluations = read_evaluations(job / "evaluations.csv")
    assert evaluations.final_score[seed] == evaluations.final_score.max()
    replay = data_of(text)["replay"]
    for phase, at in (("before", 0), ("after", -1)):
        films = replay["films"][phase]
        assert sum(film["success"] for film in films) == evaluations.catches[seed, at]
        lengths = [len(film["shots"]) - 1 for film in films]
        assert np.mean(lengths) == pytest.approx(evaluations.lengths[seed, at])
    assert [told["success"] for told in replay["told"]] == [it["success"] for it in films]
    assert [len(told["seen"]) for told in replay["told"]] == lengths


def test_the_rules_that_light_up_are_those_that_fire(text: str, job: Path) -> None:
    seed = int(re.findall(r"the run with seed (\d+)", text)[0])
    rules, told = load_rules(job, seed), data_of(text)["replay"]["told"][0]
    points = torch.tensor(told["seen"], dtype=torch.float64)
    expected = rules.firing(points).flatten(1)
    for row, fired in zip(expected, told["fired"], strict=True):
        shown = torch.zeros_like(row)
        for rule, strength in fired:
            shown[rule] = strength
        assert torch.allclose(shown, row, atol=0.02)
    cells = re.findall(r'data-rule="(\d+)" title="(.*?)">(.*?)<', text)
    numbers = [f"{value:.3f}" for value in rules.consequents.flatten().tolist()]
    assert [value for _, _, value in cells] == numbers
    premises = [rules.premise(labels) for labels, _ in rules.rules()]
    assert [words for _, words, _ in cells] == [
        f"if {premise} then value is {number}"
        for premise, number in zip(premises, numbers, strict=True)
    ]


def test_the_surface_is_that_of_the_rules(text: str, job: Path) -> None:
    seed = int(re.findall(r"the run with seed (\d+)", text)[0])
    rules = load_rules(job, seed)
    actions = torch.tensor(rules.candidates, dtype=torch.float64)
    x = torch.linspace(*rules.states[0].span(), 61, dtype=torch.float64)
    points = torch.cartesian_prod(x, actions)
    shown = torch.tensor([cell["q"] for cell in values_of(text, "Q over", 0)]).double()
    assert torch.allclose(shown, rules.evaluate(points), atol=1e-4)
    line = [each["y"] for each in values_of(text, "Q over", 1) if each["line"] == "greedy"]
    assert line == pytest.approx(rules.greedy(x.unsqueeze(-1)).tolist(), abs=1e-4)


def test_the_course_of_the_weights_ends_at_the_learned_ones(text: str, job: Path) -> None:
    seed = int(re.findall(r"the run with seed (\d+)", text)[0])
    rules = load_rules(job, seed)
    ends = {value["name"]: value["y"] for value in values_of(text, "The consequents")}
    learned = {
        f"if {rules.premise(labels)}": float(rules.consequents.flatten()[n])
        for n, (labels, _) in enumerate(rules.rules())
    }
    assert len(ends) == charts.COLOURS
    assert ends == pytest.approx({name: learned[name] for name in ends}, abs=1e-3)


def test_a_sweep_has_the_paired_differences_from_its_best(tmp_path: Path) -> None:
    lams = ",".join(f"{i / 10:g}" for i in range(charts.COLOURS + 2))
    jobs = grid({"lam": lams}, "situations=10")
    write_experiment(tmp_path, jobs, lambda settings: 4.5 - 2 * settings["lam"], runs=6)
    text = text_of(tmp_path)
    scores = [read_evaluations(tmp_path / f"{n}" / "evaluations.csv").mean_score for n in range(9)]
    order = sorted(range(9), key=lambda n: -scores[n].mean())
    rows = re.findall(r"<tr>\n((?:<td>.*?</td>\s*)+)</tr>", text)
    cells = [re.findall(r"<td>(.*?)</td>", row) for row in rows]
    assert [row[0] for row in cells] == [f"{n / 10:g}" for n in order]
    second = paired_difference(scores[order[1]], scores[order[0]])
    assert cells[1][5] == interval_words(second.mean, signed=True)
    assert cells[1][6] == interval_words(second.improvement)
    assert f"The {charts.COLOURS} best of 9 configurations are shown." in text
    assert len({value["line"] for value in values_of(text, "Learning curves")}) == charts.COLOURS
    assert "There is no replay: " in text  # there are no checkpoints


def test_a_run_directory_puts_no_script_into_the_page(copy: Path) -> None:
    """Names of jobs, overrides, values of keys and quoted files are shown as text."""
    root = copy.parent / EVIL.replace("/", "∕")
    root.mkdir()
    copy.rename(root / "job")
    settings = root / "job" / ".hydra"
    config = json.loads((settings / "config.yaml").read_text())
    config["rules"]["prior"] = EVIL
    task = {"overrides": {"task": ["lam=0.2", f"value.names={EVIL}"]}}
    (settings / "hydra.yaml").write_text(json.dumps({"hydra": task}))
    (settings / "config.yaml").write_text(json.dumps(config))
    unread = root / f"1{root.name}" / ".hydra"
    unread.mkdir(parents=True)
    (unread / "config.yaml").write_text("{}")
    text = text_of(root)
    elements = Elements(text)
    assert text.count("alert(1)") >= 5
    assert [tag for tag, _ in elements.found].count("script") == 3
    assert not {"img", "iframe", "object", "embed", "base", "link"} & {
        tag for tag, _ in elements.found
    }
    for _, attributes in elements.found:
        assert not [name for name in attributes if name.startswith("on")]
    assert "alert(1)" not in "".join(elements.scripts[1:])


def test_parts_that_are_missing_say_why(tmp_path: Path) -> None:
    overrides = "value=mlp", "evaluation=none", "num_seeds=1"
    text = text_of(train_job(tmp_path / "mlp", *FEW, *SMALL_WORLD, *overrides))
    assert "value=mlp has no rules; fnnq, fnnq_sum and fuzzy_q have." in text
    assert "The job plays no tests (evaluation=none)" in text
    assert "train with checkpoint.snapshots=true" in text
    assert "One run, so there is no interval." in text
    assert "Q over bearing and steer" in text
    assert "in 1 job." in text


def test_a_classic_world_is_replayed_in_shapes(tmp_path: Path) -> None:
    overrides = "task=mountain_car", "value=fnnq", "env.time_limit_steps=4", "evaluation=random"
    text = text_of(train_job(tmp_path / "car", *FEW, *overrides))
    replay = data_of(text)["replay"]
    assert "There is no picture: " not in text
    for films in replay["films"].values():
        assert len(films) == page.drives._SITUATIONS
        for film in films:
            assert [film[key] for key in ("steps", "every", "success")] == [4, 1, False]
            assert len(film["shots"]) == 5
            assert all(len(shot) == len(film["shots"][0]) for shot in film["shots"])
    film, told = replay["films"]["after"][0], replay["told"][0]
    places = [number for number, look in enumerate(film["looks"]) if look == {"fill": "body"}]
    for (position, *_), shot in zip(told["seen"], film["shots"], strict=False):
        [body] = [corners for look, corners in shot if look in places]
        assert sum(x for x, _ in body) / 4 == pytest.approx(position, abs=0.1)


def test_long_situations_are_thinned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page.drives, "_MOST", 3)
    overrides = "task=mountain_car", "value=fnnq", "env.time_limit_steps=7", "evaluation=random"
    replay = data_of(text_of(train_job(tmp_path / "car", *FEW, *overrides)))["replay"]
    film, told = replay["films"]["after"][0], replay["told"][0]
    assert (film["steps"], film["every"]) == (told["steps"], told["every"]) == (7, 3)
    assert len(film["shots"]) == len(told["seen"]) + 1 == 4  # steps 0, 3, 6 and the last


def test_a_world_without_a_drawing_is_replayed_in_numbers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shot_of(*_: object) -> None:
        raise ConfigError("it has no picture")

    monkeypatch.setattr("fnnq_torchrl.training.watching.shot_of", shot_of)
    overrides = "task=mountain_car", "value=fnnq", "env.time_limit_steps=4", "evaluation=random"
    text = text_of(train_job(tmp_path / "car", *FEW, *overrides))
    replay = data_of(text)["replay"]
    assert "There is no picture: it has no picture" in text
    assert replay["films"] is None
    assert len(replay["told"]) == page.drives._SITUATIONS
    assert 'id="world"' not in text


def test_the_page_has_every_colour_of_the_shapes() -> None:
    css = files("fnnq_torchrl.studies.report").joinpath("report.css").read_text()
    assert all(css.count(f"--{ink}:") == 2 for ink in INKS)


def test_a_damaged_job_still_has_its_scores(copy: Path) -> None:
    (copy / "checkpoint.pt").write_bytes(b"\x00")
    (copy / "snapshots.pt").write_bytes(b"\x00")
    text = text_of(copy)
    assert "Learning curves" in text
    assert text.count('class="missing"') >= 4
    assert "checkpoint.pt" in text


def test_adaptive_parameters_of_the_evaluations_are_drawn(copy: Path) -> None:
    path = copy / "evaluations.csv"
    numbers = np.array([[0.4, 0.3, 0.2], [0.4, 0.1, 0.0]])
    with open(path, newline="") as file:
        rows = [*csv.DictReader(file)]
    for row, number in zip(rows, numbers.flat, strict=True):
        row |= {"alpha": str(number), "gamma": "0.95"}
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    text = text_of(copy)
    shown = [value["y"] for value in values_of(text, "α while learning")]
    assert shown == pytest.approx(numbers.mean(axis=0).tolist())
    assert "γ while learning" not in text


@pytest.mark.parametrize(
    ("hydra", "multirun", "command"),
    [
        ({"overrides": {"task": ["lam=0.2", "a=b c"]}}, None, "lam=0.2 'a=b c'"),
        ({}, {"overrides": {"task": ["lam=0,1"]}}, "lam=0,1 -m"),
        ({"overrides": {"task": []}, "job": {"config_name": "saved"}}, None, "from={}"),
        ({"overrides": {"task": [["nested"]]}}, None, "from={}"),
        (None, None, "from={}"),
    ],
)
def test_the_command_that_trains_again(
    hydra: Any, multirun: Any, command: str, tmp_path: Path
) -> None:
    job = tmp_path / "0"
    (job / ".hydra").mkdir(parents=True)
    if hydra is not None:
        (job / ".hydra" / "hydra.yaml").write_text(json.dumps({"hydra": hydra}))
    if multirun is not None:
        (tmp_path / "multirun.yaml").write_text(json.dumps({"hydra": multirun}))
    assert command_of(job) == f"python -m fnnq_torchrl.train {command.format(job)}"


def status_of(*words: object) -> int | str:
    """Run the command and return its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["report", *map(str, words)])
        try:
            report.main()
        except SystemExit as end:
            return end.code or 0
    return 0


def test_the_command_writes_the_file(
    job: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    to = tmp_path / "page.html"
    assert status_of(f"run={job}", f"to={to}") == 0
    assert capsys.readouterr().err == f"report: {to}\n"
    assert to.read_text().startswith("<!DOCTYPE html>")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "run=… is missing"),
        (["run=nowhere"], "nowhere: there is no such directory"),
        (["runn=x"], "did you mean run?"),
        (["run=x", "own=1"], "own=1: must be true or false"),
    ],
)
def test_a_mistake_is_one_line(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status = status_of(*words)
    message = capsys.readouterr().err + (status if isinstance(status, str) else "")
    assert line in message
    assert message.strip().count("\n") == 0
    assert status != 0


def test_without_its_library_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    charts.libraries.cache_clear()
    monkeypatch.setitem(sys.modules, "vl_convert", None)
    monkeypatch.setattr(charts, "installing", lambda extra: f"pip install {extra}")
    with pytest.raises(ConfigError, match=r"^the report's charts need vl-convert; pip install rep"):
        charts.libraries()
