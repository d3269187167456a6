"""The output of a command on the terminal: progress, log lines and the final table."""

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

# Without a terminal, a line of progress is printed after each of these equal parts.
_PARTS = 5
# The most rows, one for each configuration, in a sweep's table.
_ROWS = 20
# Replacements for terminals where printing Greek letters would fail.
_LATIN = {"λ": "lam", "α": "alpha", "γ": "gamma", "ε": "epsilon"}


class _Console(Console):
    """A console that raises a broken pipe as an OSError, for which rich would end the program."""

    def on_broken_pipe(self) -> None:
        raise  # the error that rich is handling


class Progress:
    """Shows progress on stderr: a bar with the time left on a terminal, else a few lines.

        with Progress(4400, "learning") as progress:
            progress.update(22)

    Args:
        total: the amount of work, at least 1.
        description: the word for the work, such as ``learning``.
        unit: the plural noun for the units of work, such as ``situations``.
        console: the console to write to; by default, stderr.
        clock: returns the seconds since a fixed moment.
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
        self._console = console or _Console(stderr=True)
        self._clock = clock
        self._started_s = clock()
        self._parts_done = 0
        self._bar: progress.Progress | None = None
        # isatty is asked, too: with FORCE_COLOR, rich takes a log file for a terminal.
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
        """Show the amount of work done so far, which must not be less than before."""
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
    """Print a line, on stderr unless a console is given.

    If the line can't be written, for example to a log on a full disk, it is dropped.
    """
    console = console or _Console(stderr=True)
    with suppress(OSError):
        console.print(line, soft_wrap=True, markup=False, highlight=False)


def say(text: str, console: Console | None = None) -> None:
    """Print a command's result unchanged, to standard output unless another console is given."""
    (console or _Console()).print(text, soft_wrap=True, markup=False, highlight=False, emoji=False)


def line_label(directory: Path, part: str = "") -> str:
    """Return the beginning of a log line, which names the job or the batch.

    Args:
        directory: the directory of the job or the sweep; left out of the label on a terminal.
        part: the words for a batch among several, such as ``batch 2 of 3``.
    """
    words = [] if sys.stderr.isatty() else [_shown(directory)]
    words += [part] if part else []
    return f"{', '.join(words)}: " if words else ""


def print_summary(summary: Summary, picture: Path | None, console: Console | None = None) -> None:
    """Print the main numbers of a job, and the path of its picture.

    Args:
        summary: the summary of the job; scores are shown with two decimals.
        picture: the path of the learning curve, or None if there is none. It is printed on one line
            even in a narrow terminal, as a relative path if it is inside the current directory.
        console: the console to print to; by default, standard output.
    """
    console = console or _Console()
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
        table.add_row("score", f"{summary['measure']} of an episode, mean")
    table.add_row("learning steps", f"{summary['learning_steps']:,}")
    rate = summary["learning_steps_per_second"]
    table.add_row("learning steps per second", "unknown" if rate is None else f"{rate:,.0f}")
    console.print(table)
    if picture is not None:
        print_picture("learning curve", picture, console)


def print_sweep(
    scores: Sequence[tuple[str, NDArray[np.float64]]],
    score: Score,
    console: Console | None = None,
) -> None:
    """Print the scores of a sweep's configurations, the best first.

    Args:
        scores: the name of each configuration, and the mean scores of its runs, ``[runs]``.
        score: the score of all configurations.
        console: the console to print to; by default, standard output.
    """
    console = console or _Console()
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


def print_picture(name: str, path: Path, console: Console | None = None) -> None:
    """Print the name and the path of a picture, to standard output by default."""
    announce(f"{name}: {_shown(path)}", console or Console())


def _shown(path: Path) -> str:
    """Return a path, relative if it is inside the current directory, else absolute."""
    path = path.absolute()
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def _interval(interval: list[float] | None, confidence: float) -> str:
    if interval is None:
        return "one run, so no interval"
    low, high = interval
    return f"{100 * confidence:g} % interval {low:.2f} to {high:.2f}"
