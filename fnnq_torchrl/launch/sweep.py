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

from fnnq_torchrl.config.identity import WHICH_RUNS, JobRuns, RunsSoFar
from fnnq_torchrl.files.atomic import atomic_write, clear_leftovers
from fnnq_torchrl.training.drawing import draw_sweep
from fnnq_torchrl.training.pictures.curve import Curve
from fnnq_torchrl.training.pictures.words import key_words, setting_words
from fnnq_torchrl.training.results import (
    EVALUATION_COLUMNS,
    PARAMETERS,
    Summary,
    evaluation_columns,
    read_evaluations,
    read_summary,
)
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.terminal import announce, print_picture, print_sweep


@dataclass(frozen=True)
class SweptResult:
    """A job of a sweep, finished or not.

    Attributes:
        number: the number of the job in its sweep.
        overrides: the values that the sweep gave the job, by key.
        directory: the directory with the job's result files.
        score: the score of the job's tests.
        runs: the identities of the job's runs.
    """

    number: int
    overrides: Mapping[str, str]
    directory: Path
    score: Score
    runs: JobRuns


@dataclass(frozen=True)
class _Finished:
    """A finished job, with the seeds of the runs that no earlier job of the sweep has, too."""

    job: SweptResult
    seeds: list[int]


def write_sweep(directory: Path, jobs: Sequence[SweptResult], first: int = 0) -> None:
    """Write a sweep's own tables into its directory, and print one of its latest jobs.

    A run that several jobs have is counted once, and a line reports it. An unfinished job, which
    has no summary.json, has a row in summary.csv with its keys alone, and is left out of the other
    files.

    Args:
        directory: the directory of the sweep.
        jobs: all jobs of the sweep so far.
        first: the number of the first job whose configuration is in the table.

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
    if not (done := _finished(jobs)):
        return
    latest = [each for each in done if each.job.number >= first]
    _tell_repeated(latest)
    _write_evaluations(directory / "evaluations.csv", done, keys)
    shown = {each.job.runs.configuration for each in latest}
    for groups, score, keys in _kinds_of_score(done):
        curves = [_curve(groups[kind], keys) for kind in groups if kind in shown]
        if curves:
            print_sweep([(curve.label, curve.mean_score) for curve in curves], score)


def draw_whole(directory: Path, jobs: Sequence[SweptResult]) -> None:
    """Draw the learning curves of a sweep's finished jobs, a picture for each kind of score.

    Raises:
        OSError: if a result file can't be read.
        ValueError: if a result file is damaged; the message names the file.
    """
    kinds = _kinds_of_score(_finished(jobs))
    pictures = []
    for groups, score, keys in kinds:
        suffix = f"_{score.name}" if len(kinds) > 1 else ""
        picture = directory / f"learning_curves{suffix}.png"
        of = f"values of {key_words(keys[0])}" if len(keys) == 1 else "configurations"
        draw_sweep([_curve(group, keys) for group in groups.values()], of, picture, score)
        pictures.append(picture)
        if picture.exists():
            print_picture("learning curves", picture)
    for other in {*directory.glob("learning_curves*.png")} - {*pictures}:
        other.unlink()  # drawn when the jobs so far had other kinds of score


def _finished(jobs: Sequence[SweptResult]) -> list[_Finished]:
    """Return the finished jobs, those with a summary.json."""
    so_far = RunsSoFar()
    return [
        _Finished(job, so_far.add(job.runs))
        for job in jobs
        if (job.directory / "summary.json").exists()
    ]


def _tell_repeated(done: Sequence[_Finished]) -> None:
    """Print a line if some jobs have runs that earlier jobs have, too."""
    runs = sum(len(each.job.runs.seeds) for each in done)
    if repeated := runs - sum(len(each.seeds) for each in done):
        announce(
            f"{repeated:,} of {runs:,} runs repeat a run of an earlier job, with the same "
            "configuration and seed; they count once"
        )


_Groups = dict[str, list[_Finished]]
"""Finished jobs by their configurations."""


def _kinds_of_score(done: Sequence[_Finished]) -> list[tuple[_Groups, Score, list[str]]]:
    """Return for each kind of score its jobs by configuration, the score, and the varied keys.

    The varied keys are those in which any configurations of the sweep differ.
    """
    kinds: dict[str, _Groups] = {}
    for each in done:
        groups = kinds.setdefault(each.job.score.name, {})
        groups.setdefault(each.job.runs.configuration, []).append(each)
    # A configuration is named by the words of its first job.
    named = [group[0].job for groups in kinds.values() for group in groups.values()]
    keys = [key for key in swept_keys(named) if key not in WHICH_RUNS]
    return [
        (groups, reduce(Score.joined, (group[0].job.score for group in groups.values())), keys)
        for groups in kinds.values()
    ]


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


def _write_evaluations(path: Path, done: Sequence[_Finished], keys: Sequence[str]) -> None:
    """Write the evaluations of each run once, with its job's number and swept values in each row.

    A run that several jobs have is in the rows of the first of them.
    """
    further = ["job", *(key for key in keys if key not in ("seed", "lam"))]  # already columns
    # A run's current value of a swept key, such as alpha, has a name of its own.
    columns = [
        f"current_{name}" if name in further and name in PARAMETERS else name
        for name in EVALUATION_COLUMNS
    ]
    names = [f"config.{key}" if key in columns else key for key in further]
    with atomic_write(path) as file:
        file.write(_row([*columns, *names]).encode())
        for each in done:
            job, seeds = each.job, {*map(str, each.seeds)}
            values = {**job.overrides, "job": job.number}
            behind = "," + _row([values.get(key, "") for key in further])
            with open(job.directory / "evaluations.csv", encoding="utf-8") as rows:
                missing = len(EVALUATION_COLUMNS) - len(evaluation_columns(next(rows)))
                behind = ",nan" * missing + behind
                once = (row for row in rows if row.partition(",")[0] in seeds)
                file.write("".join(row.rstrip("\n") + behind for row in once).encode())


def _row(values: Sequence[object]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(values)
    return text.getvalue()


def _curve(group: Sequence[_Finished], keys: Sequence[str]) -> Curve:
    """Return the curve of a configuration, over each of its runs once.

    Args:
        group: the finished jobs with this configuration.
        keys: the keys in which the configurations differ.
    """
    evaluations = []
    for each in group:
        if each.seeds:
            path = each.job.directory / "evaluations.csv"
            whole = read_evaluations(path, each.job.score.measure)
            evaluations.append(whole.of(np.isin(whole.seed, each.seeds)))
    overrides = group[0].job.overrides
    words = [_words(key, overrides[key]) for key in keys if key in overrides]
    return Curve(
        name=", ".join(words) or _words("lam", str(evaluations[0].lam[0])),
        situations=evaluations[0].situations,
        scores=np.concatenate([each.score for each in evaluations]),
        diverged=sum(each.diverged_runs for each in evaluations),
    )


def _words(key: str, value: str) -> str:
    """Return the words for a key and its value; numbers are rounded to four digits."""
    try:
        return setting_words(key, float(f"{float(value):.4g}"))
    except ValueError:
        return f"{key} = {value}"
