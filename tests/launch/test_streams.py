"""Commands whose standard output or standard error is a broken pipe, a lost terminal, or closed."""

import errno
import io
import socket
import sys
from pathlib import Path

import pytest
from rich.console import Console

from fnnq_torchrl.launch import interrupted
from fnnq_torchrl.launch.interrupted import leave_interrupted
from fnnq_torchrl.launch.streams import lasting_streams, one_line
from fnnq_torchrl.training.jobs import RESULTS
from fnnq_torchrl.training.terminal import Progress, announce
from tests.commands import fnnq_train
from tests.programs import SMALL_WORLD

TINY = (*SMALL_WORLD, "situations=5", "num_seeds=1", "engine=eager")


class Gone(io.StringIO):
    """A stream whose reader is gone: EPIPE from a pipe, EIO from a terminal."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number

    def isatty(self) -> bool:
        return self.number == errno.EIO

    def write(self, text: str) -> int:
        raise OSError(self.number, "gone")

    def flush(self) -> None:
        raise OSError(self.number, "gone")


@pytest.mark.parametrize(
    ("stream", "status"),
    [(Gone(errno.EPIPE), 1), (Gone(errno.EIO), 1), (Gone(errno.ENOSPC), 1), (None, 0)],
    ids=["pipe", "terminal", "full disk", "closed"],
)
def test_a_job_goes_on_without_its_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stream: io.StringIO | None, status: int
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", stream)
    assert fnnq_train(*TINY, f"hydra.run.dir={tmp_path}") == status
    assert {*RESULTS, "learning_curve.png"} <= {path.name for path in tmp_path.iterdir()}


@pytest.mark.usefixtures("usual_signals")
def test_a_sweep_goes_on_and_one_line_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdout", Gone(errno.EPIPE))
    assert fnnq_train(*TINY, "lam=0,0.2", f"hydra.sweep.dir={tmp_path}", "-m") == 1
    assert (tmp_path / "1" / "summary.json").exists()
    assert (tmp_path / "summary.csv").exists()
    assert capsys.readouterr().err.splitlines()[-1] == "standard output: gone"


def test_a_library_that_would_exit_never_sees_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", Gone(errno.EPIPE))
    monkeypatch.setattr(sys, "stderr", Gone(errno.EPIPE))
    went_on = []

    @lasting_streams()
    def command() -> None:
        Console().print("a table")
        went_on.append(True)

    with pytest.raises(SystemExit) as ended:
        command()
    assert went_on
    assert ended.value.code == 1


def test_without_a_command_around_them_lines_are_dropped_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "stderr", Gone(errno.EPIPE))
    announce("a line")
    with Progress(1, "learning") as progress:
        progress.update(1)


def test_a_message_does_not_control_the_terminal() -> None:
    assert one_line("bad \x1b]0;title\x07\nλ = 1\u202e") == r"bad \x1b]0;title\x07 λ = 1\u202e"


@pytest.mark.usefixtures("usual_signals")
def test_a_job_without_loggers_uses_no_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used = []
    for name in ("bind", "listen", "connect", "connect_ex", "sendto"):
        monkeypatch.setattr(socket.socket, name, lambda *_, name=name: used.append(name))
    assert fnnq_train(*TINY, f"hydra.run.dir={tmp_path}") == 0
    assert not used


@pytest.mark.parametrize(
    ("threads", "status", "line"),
    [(True, 130, "interrupted; to go on: again"), (False, 1, "ended by a library that can't")],
)
def test_a_signal_that_a_library_raised_is_not_taken_for_ctrl_c(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    threads: bool,
    status: int,
    line: str,
) -> None:
    monkeypatch.setattr(interrupted, "thread_startable", lambda: threads)
    with pytest.raises(SystemExit) as ended:
        leave_interrupted("again")
    assert ended.value.code == status
    assert capsys.readouterr().err.startswith(line)
