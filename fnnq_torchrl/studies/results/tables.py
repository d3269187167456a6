"""Tables of results, a row for each configuration: for the terminal, in Markdown and as CSV."""

import csv
import io
from collections.abc import Callable

from rich.console import Console
from rich.table import Table
from rich.text import Text

from fnnq_torchrl.launch.streams import one_line
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.results.collect import Configuration, Results
from fnnq_torchrl.studies.statistics import Interval
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.words import key_words, value_words
from fnnq_torchrl.training.results import CONFIDENCE

SCORES = "mean_score", "final_score"
"""The measures in a table."""

_NAMED = 3


def mean_of(configuration: Configuration, measure: str) -> Interval:
    """Return a configuration's mean of a measure in `SCORES` over its runs, with its interval.

    The interval is Student's t, as in a job's summary.json; its bounds are NaN for a single run.
    """
    numbers = getattr(configuration.evaluations, measure)
    found = mean_interval(numbers, confidence=CONFIDENCE, bounds=configuration.score.bounds)
    return Interval(*map(float, found))


def as_table(results: Results) -> str:
    """Return the results as a table for the terminal, as wide as that is."""
    head, rows = _texts(results)
    shown = Table()
    for name in head:
        shown.add_column(Text(name), overflow="fold")
    for row in rows:
        shown.add_row(*map(Text, row))
    console = Console()
    with console.capture() as captured:
        console.print(shown)
    return captured.get().rstrip("\n")


def as_markdown(results: Results) -> str:
    """Return the results as a table in Markdown."""
    head, rows = _texts(results)
    return table(head, [[cell.replace("|", "\\|") for cell in row] for row in rows]).rstrip("\n")


def as_csv(results: Results) -> str:
    """Return the results as CSV, with the exact numbers and a column for each bound."""
    rows = []
    for each in results.configurations:
        row: dict[str, object] = {"jobs": " ".join(str(p.job.directory) for p in each.parts)}
        row |= {key: each.job.settings[key] for key in results.varied}
        row |= {"runs": each.evaluations.runs, "diverged_runs": each.evaluations.diverged_runs}
        row["measure"] = each.evaluations.measure
        for measure in SCORES:
            value, low, high = mean_of(each, measure)
            known = each.evaluations.runs > 1
            row |= {measure: value, f"{measure}_low": low if known else ""}
            row[f"{measure}_high"] = high if known else ""
        rows.append(row)
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().rstrip("\n")


FORMATS: dict[str, Callable[[Results], str]] = {
    "table": as_table,
    "markdown": as_markdown,
    "csv": as_csv,
}
"""The function for each value of ``format=``."""


def _texts(results: Results) -> tuple[list[str], list[list[str]]]:
    """Return the head and the rows of a table, as texts without control characters."""
    every = results.configurations
    several = len({each.score.words for each in every}) > 1
    diverged = any(each.evaluations.diverged_runs for each in every)
    head = ["jobs", *map(key_words, results.varied), "runs"]
    head += ["diverged"] * diverged + ["score"] * several + ["mean score", "final score"]
    rows = []
    for each in every:
        row = [_jobs(each), *(value_words(each.job.settings[key]) for key in results.varied)]
        row.append(f"{each.evaluations.runs:,}")
        row += [f"{each.evaluations.diverged_runs:,}"] * diverged
        row += [each.score.words] * several
        row += [interval_words(mean_of(each, measure)) for measure in SCORES]
        rows.append([*map(one_line, row)])
    return head, rows


def _jobs(configuration: Configuration) -> str:
    names = [part.job.directory.name for part in configuration.parts]
    if len(names) <= _NAMED:
        return ", ".join(names)
    return f"{names[0]}, …, {names[-1]} ({len(names):,} jobs)"
