"""The files of a sweep as a whole: its evaluations.csv, summary.csv and learning_curves.png.

They are made only from the result files of the jobs.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path

import numpy as np

from fnnq_torchrl.files.atomic import atomic_write, clear_leftovers
from fnnq_torchrl.training.drawing import draw_sweep
from fnnq_torchrl.training.pictures.curve import Curve
from fnnq_torchrl.training.pictures.words import key_words, setting_words
from fnnq_torchrl.training.results import (
    EVALUATION_COLUMNS,
    Evaluations,
    Summary,
    read_evaluations,
    read_summary,
)
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.terminal import print_sweep

_WHICH_RUNS = ("seed", "num_seeds")
"""Keys that choose the seeds of the runs, and so don't make another configuration."""


@dataclass(frozen=True)
class SweptResult:
    """A job of a sweep, finished or not.

    Attributes:
        number: the number of the job in its sweep.
        overrides: the values that the sweep gave the job, by key.
        directory: the directory with the job's result files.
        score: the score of the job's tests.
    """

    number: int
    overrides: Mapping[str, str]
    directory: Path
    score: Score


def write_sweep(directory: Path, jobs: Sequence[SweptResult]) -> None:
    """Write a sweep's own files into its directory, and print its table.

    An unfinished job, which has no summary.json, has a row in summary.csv with its keys alone, and
    is left out of the other files.

    Raises:
        OSError: if a file can't be read or written.
        ValueError: if a result file is damaged; the message names the file.
    """
    clear_leftovers(directory)
    keys = swept_keys(jobs)
    finished = {
        job.number: read_summary(path)
        for job in jobs
        if (path := job.directory / "summary.json").exists()
    }
    _write_summaries(directory / "summary.csv", jobs, keys, finished)
    done = [job for job in jobs if job.number in finished]
    if not done:
        return
    _write_evaluations(directory / "evaluations.csv", done, keys)
    _show(directory, done, [key for key in keys if key not in _WHICH_RUNS])


def _show(directory: Path, jobs: Sequence[SweptResult], keys: Sequence[str]) -> None:
    """Draw the curves of finished jobs and print their scores, separately for each kind of score.

    Args:
        directory: the directory of the sweep.
        jobs: the finished jobs.
        keys: the keys in which the configurations differ.
    """
    by_score: dict[str, list[SweptResult]] = {}
    for job in jobs:
        by_score.setdefault(job.score.name, []).append(job)
    of = f"values of {key_words(keys[0])}" if len(keys) == 1 else "configurations"
    pictures = []
    for name, alike in by_score.items():
        curves = _curves(alike, keys)
        score = reduce(Score.joined, (job.score for job in alike))
        suffix = f"_{name}" if len(by_score) > 1 else ""
        picture = directory / f"learning_curves{suffix}.png"
        draw_sweep(curves, of, picture, score)
        pictures.append(picture)
        scores = [(curve.label, curve.mean_score) for curve in curves]
        print_sweep(scores, picture if picture.exists() else None, score)
    for other in {*directory.glob("learning_curves*.png")} - {*pictures}:
        other.unlink()  # drawn when the jobs so far had other kinds of score


def swept_keys(jobs: Sequence[SweptResult]) -> list[str]:
    """Return the keys whose values differ between jobs, in the order of the overrides."""
    keys = dict.fromkeys(key for job in jobs for key in job.overrides)
    return [key for key in keys if len({job.overrides.get(key) for job in jobs}) > 1]


def _write_summaries(
    path: Path,
    jobs: Sequence[SweptResult],
    keys: Sequence[str],
    finished: Mapping[int, Summary],
) -> None:
    rows = [
        {"job": job.number}
        | {key: job.overrides.get(key, "") for key in keys}
        | (_columns(finished[job.number]) if job.number in finished else {})
        for job in jobs
    ]
    columns = dict.fromkeys(column for row in rows for column in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with atomic_write(path) as file:
        file.write(text.getvalue().encode())


def _columns(summary: Summary) -> dict[str, object]:
    """Return the columns of a job's summary; an interval has a column for each bound."""
    columns: dict[str, object] = {}
    for key, value in summary.items():
        if key.endswith("_interval"):
            low, high = value if isinstance(value, list) else ("", "")
            name = key.removesuffix("_interval")
            columns |= {f"{name}_low": low, f"{name}_high": high}
        else:
            # All runs of a job have the same λ; they differ only in their seeds.
            columns[key] = value[0] if isinstance(value, list) else value
    return columns


def _write_evaluations(path: Path, jobs: Sequence[SweptResult], keys: Sequence[str]) -> None:
    """Write the evaluations of all jobs, with the job's number and swept values in each row."""
    further = ["job", *(key for key in keys if key not in ("seed", "lam"))]  # already columns
    names = [f"config.{key}" if key in EVALUATION_COLUMNS else key for key in further]
    with atomic_write(path) as file:
        file.write(_row([*EVALUATION_COLUMNS, *names]).encode())
        for job in jobs:
            values = {**job.overrides, "job": job.number}
            behind = "," + _row([values.get(key, "") for key in further])
            with open(job.directory / "evaluations.csv", encoding="utf-8") as rows:
                next(rows)  # skips the header
                file.write("".join(row.rstrip("\n") + behind for row in rows).encode())


def _row(values: Sequence[object]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(values)
    return text.getvalue()


def _curves(jobs: Sequence[SweptResult], keys: Sequence[str]) -> list[Curve]:
    """Return a curve for each configuration, over all its runs, in the order of the jobs.

    Args:
        jobs: the finished jobs.
        keys: the keys in which the configurations differ.
    """
    groups: dict[tuple[str | None, ...], list[Evaluations]] = {}
    for job in jobs:
        kind = tuple(job.overrides.get(key) for key in keys)
        groups.setdefault(kind, []).append(
            read_evaluations(job.directory / "evaluations.csv", job.score.measure)
        )
    return [
        Curve(
            name=", ".join(
                _words(key, value)
                for key, value in zip(keys, kind, strict=True)
                if value is not None
            )
            or _words("lam", str(group[0].lam[0])),
            situations=group[0].situations,
            scores=np.concatenate([evaluations.score for evaluations in group]),
            diverged=sum(evaluations.diverged_runs for evaluations in group),
        )
        for kind, group in groups.items()
    ]


def _words(key: str, value: str) -> str:
    """Return the words for a key and its value; numbers are rounded to four digits."""
    try:
        return setting_words(key, float(f"{float(value):.4g}"))
    except ValueError:
        return f"{key} = {value}"
