import io
from collections.abc import Iterable
from pathlib import Path

import pytest
from rich.console import Console

from fnnq_torchrl.training.results import Summary
from fnnq_torchrl.training.terminal import Progress, line_label, print_summary

SUMMARY = Summary(
    runs=22,
    lam=[0.2],
    diverged_runs=0,
    learning_steps=1_234_567,
    batch_runs=22,
    train_seconds=10.0,
    compile_seconds=0.0,
    evaluate_seconds=1.0,
    learning_steps_per_second=123_456.7,
    mean_score=3.456,
    mean_score_interval=[3.211, 3.701],
    final_score=4.5,
    final_score_interval=[4.25, 4.75],
    confidence=0.95,
    measure="successes",
)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def progress_lines(total: int, done: Iterable[int], seconds_each: float) -> list[str]:
    """Return the lines shown without a terminal, if all steps take equally long."""
    now = 0.0
    console = Console(file=io.StringIO())
    with Progress(total, "learning", console=console, clock=lambda: now) as progress:
        for count in done:
            now = count * seconds_each
            progress.update(count)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_without_a_terminal_a_plain_line_for_every_fifth() -> None:
    assert progress_lines(4400, range(0, 4401, 22), seconds_each=0.01) == [
        "learning: 20 % of 4,400 situations, 35 s left",
        "learning: 40 % of 4,400 situations, 26 s left",
        "learning: 60 % of 4,400 situations, 18 s left",
        "learning: 80 % of 4,400 situations, 9 s left",
        "learning: 100 % of 4,400 situations, took 44 s",
    ]


def test_large_strides_give_fewer_lines() -> None:
    assert progress_lines(100, [10, 50, 55, 100], seconds_each=1.0) == [
        "learning: 50 % of 100 situations, 50 s left",
        "learning: 100 % of 100 situations, took 100 s",
    ]


def test_long_times_are_told_in_minutes_and_hours() -> None:
    assert progress_lines(100, [20, 99, 100], seconds_each=120) == [
        "learning: 20 % of 100 situations, 2 h 40 min left",
        "learning: 99 % of 100 situations, 2 min left",
        "learning: 100 % of 100 situations, took 3 h 20 min",
    ]


def test_a_terminal_gets_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    terminal = Terminal()
    with Progress(100, "evaluating", console=Console(file=terminal)) as progress:
        progress.update(100)
    shown = terminal.getvalue()
    assert "evaluating" in shown
    assert "100%" in shown
    assert "\x1b[" in shown


@pytest.mark.parametrize(
    ("file", "variable", "value"),
    [(io.StringIO(), "FORCE_COLOR", "1"), (Terminal(), "TERM", "dumb")],
    ids=["colour forced into a file", "dumb terminal"],
)
def test_what_cannot_show_a_bar_gets_plain_lines(
    monkeypatch: pytest.MonkeyPatch, file: io.StringIO, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    with Progress(10, "learning", console=Console(file=file)) as progress:
        progress.update(10)
    assert file.getvalue() == "learning: 100 % of 10 situations, took 0 s\n"


def test_progress_keeps_out_of_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress(10, "learning") as progress:
        progress.update(10)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("learning: 100 %")


def printed(summary: Summary, picture: Path, width: int = 80) -> list[str]:
    console = Console(file=io.StringIO(), width=width)
    print_summary(summary, picture, console)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


def test_the_table_holds_the_numbers() -> None:
    *table, _ = printed(SUMMARY, Path("learning_curve.png"))
    rows = dict([[cell.strip() for cell in row.split("│")[1:3]] for row in table[1:-1]])
    assert rows == {
        "runs": "22",
        "λ": "0.2",
        "mean score": "3.46, 95 % interval 3.21 to 3.70",
        "final score": "4.50, 95 % interval 4.25 to 4.75",
        "learning steps": "1,234,567",
        "learning steps per second": "123,457",
    }


def test_a_single_run_has_no_interval_and_says_so() -> None:
    summary = SUMMARY | Summary(
        mean_score_interval=None, final_score_interval=None, learning_steps_per_second=None
    )
    text = "\n".join(printed(summary, Path("learning_curve.png")))
    assert "3.46, one run, so no interval" in text
    assert "unknown" in text


def test_the_picture_s_path_is_relative_and_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    below = Path("outputs", "[bold]" + "x" * 60, "learning_curve.png")
    for picture in (below, tmp_path / below):
        assert printed(SUMMARY, picture, width=40)[-1] == f"learning curve: {below}"


def test_a_path_elsewhere_is_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    picture = tmp_path / "there" / "learning_curve.png"
    assert printed(SUMMARY, picture)[-1] == f"learning curve: {picture}"


def test_no_colour_where_none_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    terminal = Terminal()
    print_summary(SUMMARY, Path("learning_curve.png"), Console(file=terminal))
    assert "\x1b[3" not in terminal.getvalue()


def test_a_terminal_without_greek_letters_shows_the_table_too() -> None:
    raw = io.BytesIO()
    console = Console(file=io.TextIOWrapper(raw, encoding="ascii", write_through=True))
    print_summary(SUMMARY, Path("learning_curve.png"), console)
    assert b"| lam " in raw.getvalue()


@pytest.mark.parametrize(
    ("terminal", "part", "label"),
    [
        (False, "", "outputs/sweep: "),
        (False, "batch 2 of 3", "outputs/sweep, batch 2 of 3: "),
        (True, "", ""),
        (True, "batch 2 of 3", "batch 2 of 3: "),
    ],
)
def test_a_line_says_whose_it_is(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, terminal: bool, part: str, label: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.stderr", Terminal() if terminal else io.StringIO())
    assert line_label(tmp_path / "outputs" / "sweep", part) == label
