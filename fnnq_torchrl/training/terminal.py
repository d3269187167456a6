"""The output of a command on the terminal: its progress, and the table at its end."""

import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray
from rich import progress
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.results import CONFIDENCE, Summary, best_first
from fnnq_torchrl.training.score import Score

# Without a terminal, progress is a line for each of these equal parts of the work.
_PARTS = 5
# The most configurations in a sweep's table.
_ROWS = 20
# For terminals that can't show Greek letters, where printing them would fail.
_LATIN = {"λ": "lam", "α": "alpha", "γ": "gamma", "ε": "epsilon"}


class Progress:
    """A bar with the time left on a terminal, a few plain lines elsewhere; both on stderr.

        with Progress(4400, "learning") as progress:
            progress.update(22)

    Args:
        total: the amount of work, at least 1.
        description: the word for the work, such as ``learning``.
        unit: the word for what is counted, in the plural.
        console: writes the progress; to stderr, if not given.
        clock: returns the seconds since any moment.
    """

    def __init__(
        self,
        total: int,
        description: str,
        unit: str = "situations",
        console: Console | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._total, self._description, self._unit = total, description, unit
        self._console = console or Console(stderr=True)
        self._clock = clock
        self._started_s = clock()
        self._parts_done = 0
        self._bar: progress.Progress | None = None
        # isatty too: with FORCE_COLOR, rich takes a log file for a terminal.
        if self._console.is_interactive and self._console.file.isatty():
            self._bar = progress.Progress(
                progress.TextColumn("{task.description}"),
                progress.BarColumn(),
                progress.TaskProgressColumn(),
                progress.TimeRemainingColumn(elapsed_when_finished=True),
                console=self._console,
                get_time=clock,
            )
            self._task = self._bar.add_task(description, total=total)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def update(self, done: int) -> None:
        """Show how much is done so far; never less than before."""
        if self._bar is not None:
            self._bar.update(self._task, completed=done)
            return
        parts_done = done * _PARTS // self._total
        if parts_done > self._parts_done:
            self._parts_done = parts_done
            self._print_line(done)

    def _print_line(self, done: int) -> None:
        elapsed_s = self._clock() - self._started_s
        if done < self._total:
            when = f"{_duration(elapsed_s * (self._total - done) / done)} left"
        else:
            when = f"took {_duration(elapsed_s)}"
        announce(
            f"{self._description}: {100 * done // self._total} % "
            f"of {self._total:,} {self._unit}, {when}",
            self._console,
        )


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"


def announce(line: str, console: Console | None = None) -> None:
    """Print a line beside the progress, on stderr unless a console is given.

    If it can't be written, for example to a log on a full disk, the work goes on without it.
    """
    console = console or Console(stderr=True)
    with suppress(OSError):
        console.print(line, soft_wrap=True, markup=False, highlight=False)


def say(text: str, console: Console | None = None) -> None:
    """Print a command's result unchanged, to standard output unless another console is given."""
    (console or Console()).print(text, soft_wrap=True, markup=False, highlight=False, emoji=False)


def line_label(directory: Path, part: str = "") -> str:
    """Return the beginning of a log line, the name of its job or batch.

    Args:
        directory: of the job or the sweep; left out on a terminal, which shows one command.
        part: the batch among several, in words.
    """
    words = [] if sys.stderr.isatty() else [_shown(directory)]
    words += [part] if part else []
    return f"{', '.join(words)}: " if words else ""


def print_summary(summary: Summary, picture: Path | None, console: Console | None = None) -> None:
    """Print the main numbers of a job, and the path of its picture.

    Args:
        summary: of the job; its scores are shown with two decimals.
        picture: shown relative to the current directory if it lies below it, on one line even if
            the terminal is narrower. None if it couldn't be drawn.
        console: prints; to standard output, if not given.
    """
    console = console or Console()
    table = Table(show_header=False)
    table.add_column(overflow="fold")
    table.add_column(overflow="fold")
    table.add_row("runs", f"{summary['runs']:,}")
    if summary["diverged_runs"]:
        table.add_row("diverged runs", f"{summary['diverged_runs']:,}")
    lam = _LATIN["λ"] if console.options.ascii_only else "λ"
    table.add_row(lam, ", ".join(f"{value:g}" for value in summary["lam"]))
    for name, mean, interval in (
        ("mean score", summary["mean_score"], summary["mean_score_interval"]),
        ("final score", summary["final_score"], summary["final_score_interval"]),
    ):
        table.add_row(name, f"{mean:.2f}, {_interval(interval, summary['confidence'])}")
    if summary["measure"] != "successes":
        table.add_row("score", f"{summary['measure']} of the test's episodes")
    table.add_row("learning steps", f"{summary['learning_steps']:,}")
    rate = summary["learning_steps_per_second"]
    table.add_row("learning steps per second", "unknown" if rate is None else f"{rate:,.0f}")
    console.print(table)
    if picture is not None:
        _print_path(console, "learning curve", picture)


def print_sweep(
    scores: Sequence[tuple[str, NDArray[np.float64]]],
    picture: Path | None,
    score: Score,
    console: Console | None = None,
) -> None:
    """Print the scores of a sweep's configurations, the best first, and the path of its picture.

    Args:
        scores: each configuration's name, and the mean score of each of its runs, ``[runs]``.
        picture: as in :func:`print_summary`.
        score: that of all configurations.
        console: prints; to standard output, if not given.
    """
    console = console or Console()
    table = Table()
    for heading in ("configuration", "runs", "mean score"):
        table.add_column(heading, overflow="fold")
    order = best_first([of_runs for _, of_runs in scores], score.measure)
    for name, of_runs in (scores[place] for place in order[:_ROWS]):
        if console.options.ascii_only:
            name = "".join(_LATIN.get(letter, letter) for letter in name)
        mean, low, high = mean_interval(of_runs, confidence=CONFIDENCE, bounds=score.bounds)
        interval = None if len(of_runs) == 1 else [float(low), float(high)]
        table.add_row(
            Text(name), f"{len(of_runs):,}", f"{mean:.2f}, {_interval(interval, CONFIDENCE)}"
        )
    console.print(table)
    if len(scores) > _ROWS:
        announce(f"the best {_ROWS} of {len(scores):,}; all are in summary.csv", console)
    if picture is not None:
        _print_path(console, "learning curves", picture)


def _print_path(console: Console, name: str, path: Path) -> None:
    announce(f"{name}: {_shown(path)}", console)


def _shown(path: Path) -> str:
    """Return a path relative to the current directory if it lies below it."""
    path = path.absolute()
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _interval(interval: list[float] | None, confidence: float) -> str:
    if interval is None:
        return "one run, so no interval"
    low, high = interval
    return f"{100 * confidence:g} % interval {low:.2f} to {high:.2f}"
