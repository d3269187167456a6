"""Results as a pandas frame, in Python."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.results.collect import Part, Results, collect
from fnnq_torchrl.training.results import EVALUATION_COLUMNS, PARAMETERS

if TYPE_CHECKING:
    from pandas import DataFrame


def load_results(
    *directories: str | Path, evaluations: bool = False, own: bool = False
) -> "DataFrame":
    """Return the results of all finished jobs in and below some directories, as a pandas frame.

    A run that several jobs have is in the frame once, as that of the first of them. A job that
    hasn't finished or is damaged is left out; ``python -m fnnq_torchrl.results`` says which.

    Args:
        *directories: the directories of jobs, sweeps or experiments.
        evaluations: True for a row for each run and evaluation, False for a row for each run.
        own: True to import the user's own classes that configurations name. Don't set this for
            somebody else's jobs.

    Returns:
        A frame with the column ``job``, the job's directory, and a column for each key in which the
        configurations differ, by its full name such as ``env.speed_mps``. Then, for a row for each
        run: ``seed``, ``diverged`` and each of `MEASURES`; for a row for each evaluation:
        ``score`` and the columns of evaluations.csv. If a key such as ``alpha`` differs, the column
        of its current value is ``current_alpha``; another key with the name of a column, such as
        ``situations``, becomes ``config.situations``. The evaluations.csv of a sweep does the same.

    Raises:
        ModuleNotFoundError: if pandas isn't installed.
        ValueError: if a directory doesn't exist, or there are no results. One line.
    """
    try:
        import pandas
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"load_results needs pandas; {installing('pandas')}") from error
    results = collect([*map(Path, directories)], own=own)
    columns = _of_evaluations if evaluations else _of_runs
    parts = [part for each in results.configurations for part in each.parts if part.seeds]
    frames = []
    for part in parts:
        settings = _settings(part, results)
        found = {
            f"current_{name}" if name in settings and name in PARAMETERS else name: column
            for name, column in columns(part).items()
        }
        taken = found.keys() - {"lam"}  # λ is the same in both
        named = {f"config.{key}" if key in taken else key: value for key, value in settings.items()}
        frames.append(pandas.DataFrame(named | found))
    return pandas.concat(frames, ignore_index=True)


def _settings(part: Part, results: Results) -> dict[str, Any]:
    """Return the part's directory and its values of the varied keys."""
    settings = {key: _cell(part.job.settings[key]) for key in results.varied}
    return {"job": str(part.job.directory), **settings}


def _cell(value: Any) -> Any:
    """Return a value as one cell: a list as its text, since pandas takes it for a column."""
    return str(value) if isinstance(value, list) else value


def _of_runs(part: Part) -> dict[str, Any]:
    evaluations = part.evaluations
    columns = {"seed": evaluations.seed, "diverged": evaluations.diverged[:, -1]}
    return columns | {name: measure.of(evaluations) for name, measure in MEASURES.items()}


def _of_evaluations(part: Part) -> dict[str, Any]:
    evaluations = part.evaluations
    shape = evaluations.score.shape
    columns = {}
    for name in EVALUATION_COLUMNS:
        column = evaluations.column(name)
        if name != "situations" and column.ndim == 1:  # a number for each run
            column = column[:, np.newaxis]
        columns[name] = np.broadcast_to(column, shape).ravel()
    return columns | {"score": evaluations.score.ravel()}
