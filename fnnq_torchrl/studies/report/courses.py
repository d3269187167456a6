"""The part of the report on what changes while learning: weights and adaptive parameters."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.studies.report.charts import COLOURS, Chart, Line, Missing, line_chart
from fnnq_torchrl.studies.results.collect import Configuration, Results
from fnnq_torchrl.studies.rules.job import Chosen
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.jobs import SNAPSHOTS
from fnnq_torchrl.training.pictures.words import key_words
from fnnq_torchrl.training.weights import load_snapshots

ADAPTIVE = "alpha", "temperature", "gamma"
"""The columns of evaluations.csv with parameters that change while learning."""

_SITUATIONS = "learning situations"


def parameter_charts(results: Results, ordered: Sequence[Configuration]) -> list[Chart]:
    """Return a chart for each adaptive parameter that the files of the best configurations have.

    Args:
        results: the results, for the names of the configurations.
        ordered: the configurations, the best first.

    Raises:
        OSError: if a file can't be read.
        ValueError: if a column has other numbers of rows than the file's other columns.
        Missing: if there is no such parameter.
    """
    charts = []
    for name in ADAPTIVE:
        lines, changes = [], False
        for each in ordered[:COLOURS]:
            values = _column(each, name)
            if values is not None:
                mean, low, high = mean_interval(values)
                known = mean[np.isfinite(mean)]  # there is no temperature without Boltzmann
                changes = changes or (known.size > 0 and bool(np.ptp(known) > 0))
                band = (low, high) if len(values) > 1 else (None, None)
                lines.append(Line(results.label(each), each.evaluations.situations, mean, *band))
        if changes:
            words = key_words(name)
            alt = f"The mean of {words} against the learning situations."
            title = f"{words} while learning"
            charts.append(line_chart(lines, _SITUATIONS, words, title=title, alt=alt))
    if not charts:
        raise Missing(
            "α, γ and the temperature stay the same, or evaluations.csv has no such columns."
        )
    return charts


def _column(configuration: Configuration, name: str) -> NDArray[np.float64] | None:
    """Return a column of all runs, ``[runs, evaluations]``; None if a job has no such column."""
    found = []
    for part in configuration.parts:
        if not part.seeds:
            continue
        path = part.job.directory / "evaluations.csv"
        with open(path, newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            if name not in (rows.fieldnames or []):
                return None
            numbers = np.array([float(row[name]) for row in rows])
        whole = part.job.evaluations
        of_runs = numbers.reshape(whole.runs, whole.situations.size)
        found.append(of_runs[np.isin(whole.seed, part.seeds)])
    return np.concatenate(found)


def weight_charts(directory: Path, seed: int, chosen: Chosen | None) -> list[Chart]:
    """Return charts of a run's weights at each evaluation.

    They show the consequents that changed most, if the run has rules; otherwise the size of the
    weights.

    Args:
        directory: the job's directory.
        seed: the run's seed.
        chosen: the run's rules, if it has any.

    Raises:
        OSError, ValueError: if the file can't be read, or is damaged.
        Missing: if the job has kept no weights.
    """
    path = directory / SNAPSHOTS
    if not path.is_file():
        raise Missing("The job has kept no weights; train with checkpoint.snapshots=true.")
    snapshots = load_snapshots(path)
    seeds = snapshots.seed.tolist()
    if seed not in seeds:
        raise ValueError(f"{path} has no run with seed={seed}")
    of_run = {name: weight[:, seeds.index(seed)] for name, weight in snapshots.weights.items()}
    situations = snapshots.situations.numpy()
    if chosen is None:
        lines = [
            Line(name, situations, weight.double().flatten(1).square().mean(1).sqrt().numpy())
            for name, weight in of_run.items()
        ]
        alt = "The root mean square of each array of weights against the learning situations."
        return [
            line_chart(
                lines[:COLOURS],
                _SITUATIONS,
                "root mean square",
                title="The size of the weights while learning",
                alt=alt,
            )
        ]
    names = [name for name in of_run if name.endswith("weight")]
    every = torch.cat([of_run[name].double().flatten(1) for name in names], dim=1)
    premises = [part.premise(labels) for part in chosen.parts for labels, _ in part.rules()]
    most = every.std(0, correction=0).argsort(descending=True, stable=True)[:COLOURS].tolist()
    lines = [Line(f"if {premises[n]}", situations, every[:, n].numpy()) for n in most]
    note = f"The {len(lines)} of {len(premises)} rules whose consequents changed most."
    return [
        line_chart(
            lines,
            _SITUATIONS,
            "consequent",
            title="The consequents while learning",
            alt="The consequents of the rules that changed most, against the learning situations.",
            note=note,
        )
    ]
