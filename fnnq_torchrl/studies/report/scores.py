"""The part of the report on scores: learning curves, and configurations with their differences."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from fnnq_torchrl.studies.report.charts import (
    COLOURS,
    Chart,
    Line,
    interval_chart,
    line_chart,
    number_of,
)
from fnnq_torchrl.studies.reproduction.markdown import interval_words
from fnnq_torchrl.studies.results.collect import Configuration, Results
from fnnq_torchrl.studies.results.tables import mean_of
from fnnq_torchrl.studies.statistics import paired_difference
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import count_words
from fnnq_torchrl.training.pictures.words import key_words, value_words
from fnnq_torchrl.training.results import CONFIDENCE, FINAL_EVALUATIONS, best_first
from fnnq_torchrl.training.score import Score

_DOTS = 30
_PAIRS = 30


@dataclass(frozen=True)
class Row:
    """A row of the table of configurations, in words.

    Attributes:
        values: the values of the varied keys.
        jobs: the names of the jobs.
        runs, diverged: the numbers of runs.
        mean, final: the scores with their intervals.
        difference: the mean score minus that of the best configuration, over the same seeds.
        better: the probability that a run scores more than a run of the best configuration.
        seeds_needed: the number of seeds needed to see such a difference.
    """

    values: list[str]
    jobs: str
    runs: int
    diverged: int
    mean: str
    final: str
    difference: str = ""
    better: str = ""
    seeds_needed: str = ""


@dataclass(frozen=True)
class Scores:
    """The configurations with the same kind of score.

    Attributes:
        score: the score.
        ordered: the configurations, the best mean score first.
        keys: the words for the varied keys.
        rows: a row for each configuration, in the same order.
        charts: the learning curves and, of several configurations, the dots.
        notes: remarks below the table.
    """

    score: Score
    ordered: list[Configuration]
    keys: list[str]
    rows: list[Row]
    charts: list[Chart]
    notes: list[str]

    @property
    def best(self) -> Configuration:
        """The configuration with the best mean score."""
        return self.ordered[0]


def scores_of(results: Results) -> list[Scores]:
    """Return the configurations by their kind of score, in the order of the results."""
    kinds: dict[str, list[Configuration]] = {}
    for each in results.configurations:
        kinds.setdefault(each.score.words, []).append(each)
    return [_scores(results, kind) for kind in kinds.values()]


def _scores(results: Results, group: Sequence[Configuration]) -> Scores:
    score = reduce(Score.joined, (each.score for each in group))
    means = [each.evaluations.mean_score for each in group]
    ordered = [group[place] for place in best_first(means, score.measure)]
    charts = [_curves(results, ordered, score)]
    if len(ordered) > 1:
        charts.append(_dots(results, ordered, score))
    rows = [_row(results, each, ordered[0], place < _PAIRS) for place, each in enumerate(ordered)]
    keys = [key_words(key) for key in results.varied]
    return Scores(score, ordered, keys, rows, charts, _notes(ordered))


def _curves(results: Results, ordered: Sequence[Configuration], score: Score) -> Chart:
    lines = []
    for each in ordered[:COLOURS]:
        evaluations = each.evaluations
        mean, low, high = mean_interval(
            evaluations.score, confidence=CONFIDENCE, bounds=score.bounds
        )
        band = (low, high) if evaluations.runs > 1 else (None, None)
        lines.append(Line(results.label(each), evaluations.situations, mean, *band))
    runs = count_words([each.evaluations.runs for each in ordered[:COLOURS]])
    note = f"Means over {runs}; the bands are 95 % intervals of the means."
    if max(each.evaluations.runs for each in ordered[:COLOURS]) == 1:
        note = "One run, so there is no interval."
    if len(ordered) > COLOURS:
        note += f" The {COLOURS} best of {len(ordered):,} configurations are shown."
    counts = score.measure == "successes" and np.isfinite(score.high)
    return line_chart(
        lines,
        "learning situations",
        score.words,
        title="Learning curves",
        alt=f"The mean {score.words} against the learning situations, for each configuration.",
        bounds=score.bounds if counts else None,
        note=note,
    )


def _dots(results: Results, ordered: Sequence[Configuration], score: Score) -> Chart:
    rows = []
    for each in ordered[:_DOTS]:
        value, low, high = map(number_of, mean_of(each, "mean_score"))
        rows.append({"name": results.label(each), "value": value, "low": low, "high": high})
    note = "The mean over all evaluations after learning began, with its 95 % interval."
    if len(ordered) > _DOTS:
        note += f" The {_DOTS} best of {len(ordered):,} configurations are shown."
    alt = "The mean score of each configuration with its interval; the table has the numbers."
    return interval_chart(rows, score.words, title="Mean scores", alt=alt, note=note)


def _row(results: Results, each: Configuration, best: Configuration, compared: bool) -> Row:
    names = [part.job.directory.name for part in each.parts]
    row = Row(
        values=[value_words(each.job.settings[key]) for key in results.varied],
        jobs=names[0] if len(names) == 1 else f"{names[0]} to {names[-1]} ({len(names):,} jobs)",
        runs=each.evaluations.runs,
        diverged=each.evaluations.diverged_runs,
        mean=interval_words(mean_of(each, "mean_score")),
        final=interval_words(mean_of(each, "final_score")),
    )
    if each is best or not compared:
        return row
    _, ours, theirs = np.intersect1d(
        each.evaluations.seed, best.evaluations.seed, return_indices=True
    )
    if ours.size < 2:
        return Row(**vars(row) | {"difference": "too few common seeds"})
    difference = paired_difference(
        each.evaluations.mean_score[ours], best.evaluations.mean_score[theirs]
    )
    needed = difference.runs_needed
    return Row(
        **vars(row)
        | {
            "difference": interval_words(difference.mean, signed=True),
            "better": interval_words(difference.improvement),
            "seeds_needed": f"{needed:,.0f}" if np.isfinite(needed) else "no difference",
        }
    )


def _notes(ordered: Sequence[Configuration]) -> list[str]:
    evaluations = ordered[0].evaluations
    final = min(FINAL_EVALUATIONS, evaluations.situations.size - 1)
    notes = [
        "Mean score: over all evaluations after learning began. "
        f"Final score: over the last {final}. Brackets are 95 % intervals over the runs (t).",
    ]
    if len(ordered) > 1:
        notes.append(
            "Difference: the mean score minus that of the first row, over the seeds that both "
            "have, with its 95 % bootstrap interval. P(better): the probability that a run scores "
            "more than a run of the first row. Seeds: as many as are needed to see such a "
            "difference with a power of 80 %. The first row is the best of these rows, which is "
            "partly luck."
        )
    if len(ordered) > _PAIRS:
        notes.append(f"Only the first {_PAIRS} rows are compared with the first.")
    return notes
