"""A test replayed for watching is the same as the test that gave the score."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.training import watching
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.watching import play
from fnnq_torchrl.training.weights import load_checkpoint
from fnnq_torchrl.watch import main, watch
from tests.compositions import config_of


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short job with two runs."""
    directory = tmp_path_factory.mktemp("job")
    run_job(config_of("situations=5", "num_seeds=2", "env.time_limit_steps=60"), directory)
    return directory


@pytest.mark.parametrize("learned", [False, True])
def test_the_films_are_what_was_counted(job: Path, learned: bool) -> None:
    checkpoint = load_checkpoint(job / "checkpoint.pt")
    films = play(to_config(checkpoint.config), checkpoint, [0, 1], 5, learned=learned)
    evaluations = read_evaluations(job / "evaluations.csv")
    at = -1 if learned else 0
    for run in range(2):
        ends = [film[-1] for film in films[run]]
        assert all(end.ended for end in ends)
        assert sum(end.success for end in ends) == evaluations.catches[run, at]
        lengths = [len(film) - 1 for film in films[run]]
        assert sum(lengths) / 5 == pytest.approx(evaluations.lengths[run, at])
        returns = [sum(shot.reward for shot in film) for film in films[run]]
        assert sum(returns) / 5 == pytest.approx(evaluations.returns[run, at])


def test_before_learning_a_prior_is_what_steers(tmp_path: Path) -> None:
    run_job(config_of("rules=rough", "situations=5", "engine=eager"), tmp_path)
    checkpoint = load_checkpoint(tmp_path / "checkpoint.pt")
    [films] = play(to_config(checkpoint.config), checkpoint, [0], 5, learned=False)
    caught = sum(film[-1].success for film in films)
    assert caught == read_evaluations(tmp_path / "evaluations.csv").catches[0, 0] == 5


def test_panels_are_titled_and_placed(job: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: dict[str, Any] = {}

    def write_gif(films: Sequence[object], titles: Sequence[str], *_: object, **keys: Any) -> None:
        assert len(films) == len(titles)
        shown.update(titles=titles, columns=keys["columns"])

    monkeypatch.setattr(watching, "write_gif", write_gif)
    monkeypatch.setattr(watching, "write_strip", lambda *_, **__: None)
    defaults = {"to": "", "seed": "", "every": "2", "size": "100", "run": str(job)}
    watch(defaults | {"when": "both", "situations": "2"})
    before = ["before learning, situation 1", "before learning, situation 2"]
    after = [title.replace("before", "after") for title in before]
    assert shown == {"titles": (*before, *after), "columns": 2}
    watch(defaults | {"when": "both", "situations": "4", "seed": "0,1"})
    first = ["before learning, run 0, situation 1", "after learning, run 0, situation 1"]
    assert [*shown["titles"][:2]] == first
    assert shown["titles"][-1] == "after learning, run 1, situation 4"
    assert shown["columns"] == 6
    watch(defaults | {"when": "after", "situations": "5"})
    assert shown["columns"] is None


def test_the_command_leaves_a_moving_picture_and_stills(
    job: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [f"run={job}", "seed=1", "every=20", "size=100", "when=both"]
    monkeypatch.setattr(sys, "argv", ["watch", *words])
    main()
    assert capsys.readouterr().out.split() == [str(job / "robot.gif"), str(job / "robot.png")]
    with Image.open(job / "robot.gif") as film:
        assert 3 <= film.n_frames <= 4
        assert film.width == 100  # before learning above, after it below
    with Image.open(job / "robot.png") as stills:
        assert stills.width == 500


def test_a_job_without_tests_shows_new_situations(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    walk, states = tmp_path / "walk", tmp_path / "states"
    for directory, task in ((walk, "random_walk"), (states, "two_states")):
        directory.mkdir()
        run_job(config_of(f"task={task}", "situations=2", "engine=eager"), directory)
    monkeypatch.setattr(
        sys, "argv", ["watch", f"run={walk}", "situations=2", "size=60", "every=50"]
    )
    main()
    assert (walk / "robot.gif").is_file()
    monkeypatch.setattr(sys, "argv", ["watch", f"run={states}"])
    with pytest.raises(SystemExit):
        main()
    line = capsys.readouterr().err.splitlines()[-1]
    assert line == "TwoStates has no picture; env.kind=two_states can't be drawn"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ((), "run=… is missing"),
        (("run=nowhere",), "nowhere"),
        (("run=x", "seeds=1"), "seeds=1: there is no seeds; did you mean seed?"),
        (("run=x", "when=now"), "when=now: must be after or before or both"),
        (("run=x", "every=0"), "every=0: must be a whole number >= 1"),
        (("run=JOB", "seed=7"), "seed=7: must be a seed of the job, 0 to 1"),
        (("run=JOB", "situations=9"), "situations=9: must be at most 5, the size of the test"),
    ],
)
def test_mistakes_are_told_in_one_line(
    job: Path,
    words: tuple[str, ...],
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["watch", *(w.replace("JOB", str(job)) for w in words)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert line in told
