"""The page that plays with a learned controller; tests/browser opens it in a browser."""

import json
import re
import sys
import threading
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
import torch

from fnnq_torchrl import load_rules, play
from fnnq_torchrl.agent.rules.formats import WRITERS
from fnnq_torchrl.engine.native.errors import Unsupported
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.studies.play.command import make_server
from fnnq_torchrl.studies.play.page import make_page
from fnnq_torchrl.training.job import run_job
from tests.programs import SMALL_WORLD


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("job")
    run_job(load_config("situations=10", "num_seeds=2", "engine=eager", *SMALL_WORLD), directory)
    return directory


@pytest.fixture(scope="module")
def page(job: Path) -> str:
    return make_page(job, 1)


def data_of(page: str) -> dict[str, Any]:
    (text,) = re.findall(r'id="data">(.*?)</script>', page, re.DOTALL)
    data: dict[str, Any] = json.loads(text)
    return data


def test_it_needs_no_other_file(page: str) -> None:
    assert not re.search(r"(src|href)=|https?://|@import|url\(", page)
    assert not re.search(r"@(title|style|data|step|script)@", page)
    assert len(page) < 6e6


def test_it_has_the_weights_before_and_after_learning(page: str, job: Path) -> None:
    weights = data_of(page)["weights"]
    assert weights["before"]["weight"] == [0] * 20
    assert weights["after"]["weight"] == load_rules(job, 1).consequents.flatten().tolist()


def test_its_files_are_those_of_the_rules_command(page: str, job: Path) -> None:
    rules = load_rules(job, 1)
    numbers = [n / 8 - 1 for n in range(20)]
    ours = replace(rules, consequents=torch.tensor(numbers).view(5, 4))
    for file in data_of(page)["files"]:
        text = file["text"].replace("@low@", str(min(numbers))).replace("@high@", str(max(numbers)))
        filled = re.sub(r"@(\d+)@", lambda found: str(numbers[int(found[1])]), text)
        ending = Path(file["name"]).suffix
        writer = WRITERS[".c" if ending == ".h" else ending]
        assert filled.encode() == writer.write(ours, ours.candidates, "rules", False)[ending]


def test_only_this_machine_can_ask_for_it(page: str) -> None:
    with make_server(page.encode()) as server:
        host, port = server.server_address[:2]
        assert host == "127.0.0.1"
        threading.Thread(target=server.serve_forever, daemon=True).start()
        answers = []
        for path in ("/", "/etc/passwd"):
            connection = HTTPConnection(str(host), port)
            connection.request("GET", path)
            answer = connection.getresponse()
            answers.append((answer.status, answer.read().decode()))
        server.shutdown()
    assert answers == [(200, page), (404, "")]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([], "run=… is missing"),
        (["run=nowhere"], "nowhere/checkpoint.pt"),
        (["run={job}", "seed=7"], "no run with seed=7"),
        (["run={job}", "port=x"], "port=x: must be a whole number"),
        (["run={job}", "own=maybe"], "own=maybe: must be true or false"),
        (["run={job}", "ru=1"], "did you mean run"),
    ],
)
def test_a_mistake_is_one_line(
    words: list[str],
    told: str,
    job: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["play", *(word.format(job=job) for word in words)])
    with pytest.raises(SystemExit) as end:
        play.main()
    line = capsys.readouterr().err
    assert (end.value.code, line.count("\n")) == (2, 1)
    assert told in line


def short_job(directory: Path, *overrides: str) -> Path:
    few = "situations=1", "num_seeds=1", "evaluation=none", "engine=eager", "env.time_limit_steps=3"
    run_job(load_config(*overrides, *few), directory)
    return directory


def test_another_world_is_refused(tmp_path: Path) -> None:
    job = short_job(tmp_path, "task=mountain_car")
    with pytest.raises(ValueError, match=r"mountain_car; the page plays .*\.watch run="):
        make_page(job, 0)


def test_an_untranslatable_step_is_refused(job: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write_program(*_: object) -> None:
        raise Unsupported("no translation of sort")

    monkeypatch.setattr("fnnq_torchrl.studies.play.page.write_program", write_program)
    with pytest.raises(ValueError, match=r"no translation of sort.*fnnq_torchrl.watch run="):
        make_page(job, 1)


def test_the_worlds_with_obstacles_are_played_too(tmp_path: Path) -> None:
    page = make_page(short_job(tmp_path, "task=follow_obstacles"), 0)
    scene = data_of(page)["scene"]
    assert len(page) < 1e6
    assert scene["loose"] == {"disc": 3, "box": 0}
    assert [len(scene[key]) for key in ("balls", "discs", "boxes", "ring")] == [1, 3, 0, 8]
    leaves = [name for name, *_ in data_of(page)["leaves"]]
    assert {f"world/{key}" for key in (*scene["shared"], "held", "speed_mps", "noise")} < {*leaves}
    assert len(data_of(page)["rules"]["sentences"]) == 160
