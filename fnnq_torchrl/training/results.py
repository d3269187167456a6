"""The results of a finished job, and their files evaluations.csv and summary.json."""

import io
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from itertools import repeat
from math import inf
from pathlib import Path
from types import UnionType
from typing import Any, Self, TypedDict, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.intervals import mean_interval

CONFIDENCE = 0.95

FINAL_EVALUATIONS = 8
"""The number of last evaluations over which the final score is the mean."""

_RUN, _EVALUATION = "runs", "evaluations"


def _column(dtype: str, *axes: str, name: str | None = None, **default: Any) -> Any:
    """Return a dataclass field for a column of evaluations.csv, by default of the field's name.

    A column with a default is missing in older files.
    """
    return field(metadata={"dtype": np.dtype(dtype), "axes": axes, "name": name}, **default)


@dataclass(frozen=True, eq=False)
class Evaluations:
    """The content of evaluations.csv: the scores of all runs at each evaluation.

    All runs are evaluated after the same numbers of learning situations. The arrays are the columns
    of the file, in its order; later versions may add columns after these.

    Args:
        measure: the measure of the score: ``successes``, ``return`` or ``length``.

    Raises:
        ValueError: on creation, if a shape or dtype is not as stated below, there are no runs or
            fewer than two evaluations, or ``situations`` doesn't rise from 0.
    """

    seed: NDArray[np.int64] = _column("i8", _RUN)
    lam: NDArray[np.float64] = _column("f8", _RUN)
    # Learning situations before each evaluation; the first is 0.
    situations: NDArray[np.int64] = _column("i8", _EVALUATION)
    # Learning steps of the run before each evaluation.
    steps: NDArray[np.int64] = _column("i8", _RUN, _EVALUATION)
    # Episodes of the test that succeeded.
    catches: NDArray[np.int64] = _column("i8", _RUN, _EVALUATION)
    # True if the run had diverged before the evaluation; it then has no catches.
    diverged: NDArray[np.bool_] = _column("?", _RUN, _EVALUATION)
    # Returns (sums of rewards) and lengths (in steps): means over the test's episodes.
    returns: NDArray[np.float64] = _column("f8", _RUN, _EVALUATION, name="return")
    lengths: NDArray[np.float64] = _column("f8", _RUN, _EVALUATION, name="length")
    # Learning parameters at the time of the evaluation, NaN where there is none: the temperature of
    # a run without Boltzmann exploration. By default all are NaN.
    alpha: NDArray[np.float64] = _column("f8", _RUN, _EVALUATION, default=None)
    temperature: NDArray[np.float64] = _column("f8", _RUN, _EVALUATION, default=None)
    gamma: NDArray[np.float64] = _column("f8", _RUN, _EVALUATION, default=None)
    measure: str = "successes"

    def __post_init__(self) -> None:
        sizes = {_RUN: self.seed.size, _EVALUATION: self.situations.size}
        for name in PARAMETERS:
            if getattr(self, name) is None:
                missing = np.full((self.seed.size, self.situations.size), np.nan)
                object.__setattr__(self, name, missing)
        for name, item in _COLUMNS.items():
            array, dtype = getattr(self, item.name), item.metadata["dtype"]
            shape = tuple(sizes[axis] for axis in item.metadata["axes"])
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(
                    f"{name} must be {dtype} {list(shape)}, got {array.dtype} {list(array.shape)}"
                )
        if self.runs == 0:
            raise ValueError("there must be at least one run")
        if (
            sizes[_EVALUATION] < 2
            or self.situations[0] != 0
            or np.any(np.diff(self.situations) <= 0)
        ):
            raise ValueError(
                "situations must begin at 0 and rise, over at least two evaluations; "
                f"got {self.situations.tolist()}"
            )

    @property
    def runs(self) -> int:
        """The number of runs."""
        return self.seed.size

    @property
    def learning_steps(self) -> int:
        """The number of learning steps of all runs together."""
        return int(self.steps[:, -1].sum())

    @property
    def diverged_runs(self) -> int:
        """The number of runs that have diverged."""
        return int(self.diverged[:, -1].sum())

    def column(self, name: str) -> NDArray[Any]:
        """Return a column by its name in evaluations.csv, in the shape of the field."""
        array: NDArray[Any] = getattr(self, _COLUMNS[name].name)
        return array

    @property
    def score(self) -> NDArray[Any]:
        """The score of each run at each evaluation, by `measure`, ``[runs, evaluations]``."""
        scores: dict[str, NDArray[Any]] = {
            "successes": self.catches,
            "return": self.returns,
            "length": self.lengths,
        }
        return scores[self.measure]

    @property
    def mean_score(self) -> NDArray[np.float64]:
        """The mean score of each run, without the evaluation before learning, ``[runs]``."""
        return self.score[:, 1:].mean(axis=1)

    @property
    def final_score(self) -> NDArray[np.float64]:
        """The mean score of each run over its last ``FINAL_EVALUATIONS`` evaluations, ``[runs]``.

        With fewer evaluations, all count, except for the one before learning.
        """
        return self.score[:, 1:][:, -FINAL_EVALUATIONS:].mean(axis=1)

    def of(self, runs: slice | NDArray[np.bool_]) -> Self:
        """Return the evaluations of a slice of the runs, or of those that a mask marks."""
        arrays = {
            item.name: getattr(self, item.name)[runs]
            for item in _COLUMNS.values()
            if _RUN in item.metadata["axes"]
        }
        return replace(self, **arrays)

    @classmethod
    def joined(cls, several: "Sequence[Evaluations]") -> "Evaluations":
        """Return the runs of several evaluations after the same situations, one after the other."""
        first, *others = several
        arrays: dict[str, Any] = {
            item.name: np.concatenate([getattr(each, item.name) for each in several])
            for item in _COLUMNS.values()
            if _RUN in item.metadata["axes"]
        }
        return replace(first, **arrays) if others else first


_COLUMNS = {
    item.metadata["name"] or item.name: item for item in fields(Evaluations) if item.metadata
}

EVALUATION_COLUMNS = tuple(_COLUMNS)
"""The names of the columns of evaluations.csv."""

PARAMETERS = tuple(name for name, item in _COLUMNS.items() if item.default is not MISSING)
"""The columns of the learning parameters, which older files lack."""

_OLDER_COLUMNS = EVALUATION_COLUMNS[: -len(PARAMETERS)]


def evaluation_columns(header: str) -> tuple[str, ...]:
    """Return the columns that an evaluations.csv has, by its first line, without unknown ones.

    Raises:
        ValueError: if it isn't the first line of such a file.
    """
    names = tuple(header.rstrip("\n").split(","))
    for columns in (EVALUATION_COLUMNS, _OLDER_COLUMNS):
        if names[: len(columns)] == columns:
            return columns
    raise ValueError(f"its first columns must be {','.join(_OLDER_COLUMNS)}")


def best_first(scores: Sequence[NDArray[Any]], measure: str) -> list[int]:
    """Return the indices of configurations in the order of their mean scores, the best first.

    Args:
        scores: the scores of the runs of each configuration, ``[runs]``.
        measure: the measure of the scores; a smaller ``length`` is better.
    """
    sign = 1 if measure == "length" else -1
    return sorted(range(len(scores)), key=lambda place: sign * scores[place].mean())


def best_run(evaluations: Evaluations) -> int:
    """Return the index of the run with the best final score.

    The mean score decides between runs with the same final score: a final score is a mean over a
    few evaluations, so many runs may have the same.
    """
    scores = evaluations.final_score + 1e-6 * evaluations.mean_score
    return best_first([scores[i : i + 1] for i in range(evaluations.runs)], evaluations.measure)[0]


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome(Evaluations):
    """The evaluations of finished runs, and the wall times of their batch.

    The batch is all runs that were trained together, those of one job or of several jobs.
    """

    batch_runs: int
    batch_learning_steps: int  # of all runs of the batch together
    train_seconds: float  # of learning, without compiling
    compile_seconds: float
    evaluate_seconds: float


class Summary(TypedDict):
    """The keys of summary.json, in their order. Intervals are [low, high]."""

    runs: int
    diverged_runs: int  # have the worst possible score after diverging
    lam: list[float]  # the distinct values of λ, rising
    learning_steps: int  # of all runs together
    # Values of the whole batch, equal in all jobs that were trained together.
    batch_runs: int
    train_seconds: float
    compile_seconds: float
    evaluate_seconds: float
    learning_steps_per_second: float | None  # null if no time was measured
    measure: str  # of the scores: successes, return or length
    mean_score: float
    mean_score_interval: list[float] | None  # null for a single run
    final_score: float
    final_score_interval: list[float] | None
    confidence: float


def summarise(outcome: Outcome, bounds: tuple[float, float] = (-inf, inf)) -> Summary:
    """Return a job's summary: means over its runs, and their intervals.

    Args:
        outcome: the outcome of the job's runs.
        bounds: the lowest and the highest possible score; intervals are cut off there.
    """
    mean_score, mean_score_interval = _mean_over_runs(outcome.mean_score, bounds)
    final_score, final_score_interval = _mean_over_runs(outcome.final_score, bounds)
    seconds = outcome.train_seconds
    return Summary(
        runs=outcome.runs,
        diverged_runs=outcome.diverged_runs,
        lam=np.unique(outcome.lam).tolist(),
        learning_steps=outcome.learning_steps,
        batch_runs=outcome.batch_runs,
        train_seconds=seconds,
        compile_seconds=outcome.compile_seconds,
        evaluate_seconds=outcome.evaluate_seconds,
        learning_steps_per_second=outcome.batch_learning_steps / seconds if seconds > 0 else None,
        measure=outcome.measure,
        mean_score=mean_score,
        mean_score_interval=mean_score_interval,
        final_score=final_score,
        final_score_interval=final_score_interval,
        confidence=CONFIDENCE,
    )


def _mean_over_runs(
    samples: NDArray[np.float64], bounds: tuple[float, float]
) -> tuple[float, list[float] | None]:
    """Return the mean of the samples, ``[runs]``, and its interval (None for a single run)."""
    mean, low, high = mean_interval(samples, confidence=CONFIDENCE, bounds=bounds)
    return float(mean), None if samples.size == 1 else [float(low), float(high)]


def write_summary(path: Path, summary: Summary) -> None:
    """Write summary.json.

    Raises:
        OSError: if the file can't be written.
        ValueError: if a value is NaN or infinite, which JSON can't hold.
    """
    text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
    with atomic_write(path) as file:
        file.write(text.encode())


def read_summary(path: Path) -> Summary:
    """Read summary.json.

    Raises:
        OSError: if the file can't be read.
        ValueError: if the content isn't that of a summary.json; the message names the file.
    """
    data = path.read_bytes()
    try:
        summary = json.loads(data, parse_constant=_no_number)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is not a summary: {error}") from error
    hints = get_type_hints(Summary)
    if not isinstance(summary, dict) or not all(
        key in summary and _is_of(summary[key], hint) for key, hint in hints.items()
    ):
        raise ValueError(f"{path} is not a complete summary")
    return cast(Summary, summary)


def _no_number(name: str) -> float:
    raise ValueError(f"it holds {name}")


def _is_of(value: object, hint: Any) -> bool:
    """Return whether a value read from JSON has the type ``hint``, a type used in `Summary`."""
    if isinstance(hint, UnionType):
        return any(_is_of(value, each) for each in get_args(hint))
    if get_origin(hint) is list:
        return isinstance(value, list) and all(_is_of(each, float) for each in value)
    return type(value) in {float: (int, float)}.get(hint, (hint,))


def write_evaluations(path: Path, evaluations: Evaluations) -> None:
    """Write evaluations.csv: one row per run and evaluation, ordered by run, then evaluation."""
    with atomic_write(path) as file:
        file.write((",".join(EVALUATION_COLUMNS) + "\n").encode())
        file.writelines(_rows_of_each_run(evaluations))


def _rows_of_each_run(evaluations: Evaluations) -> Iterator[bytes]:
    columns: list[Iterable[Iterable[str]]] = []  # for each run, its texts
    for item in _COLUMNS.values():
        array = getattr(evaluations, item.name)
        # Converted to Python's numbers, which are formatted several times faster than NumPy's.
        # The repr of a float is the shortest text that reads back exactly.
        numbers = (array.astype(int) if array.dtype == bool else array).tolist()
        if item.metadata["axes"] == (_RUN,):
            columns.append(repeat(repr(number), evaluations.situations.size) for number in numbers)
        elif item.metadata["axes"] == (_EVALUATION,):
            columns.append(repeat([*map(repr, numbers)], evaluations.runs))
        else:
            columns.append(map(repr, of_run) for of_run in numbers)
    for run in zip(*columns, strict=True):
        yield "".join(f"{','.join(row)}\n" for row in zip(*run, strict=True)).encode()


def read_evaluations(path: Path, measure: str = "successes") -> Evaluations:
    """Read evaluations.csv; the numbers are exactly those written. Unknown columns are ignored.

    Args:
        path: the file.
        measure: the measure of the score (:attr:`envs.core.world.WorldConfig.measure`).

    Raises:
        OSError: if the file can't be read.
        ValueError: if the content isn't that of a complete evaluations.csv; the message names the
            file.
    """
    try:
        return _parse_evaluations(path.read_text(encoding="utf-8"), measure)
    except ValueError as error:
        raise ValueError(f"{path} is not a complete evaluations file: {error}") from error


def _parse_evaluations(text: str, measure: str) -> Evaluations:
    header, _, body = text.partition("\n")
    columns = {name: _COLUMNS[name] for name in evaluation_columns(header)}
    if not body.strip():
        raise ValueError("it has no rows")
    if not body.endswith("\n"):
        raise ValueError("its last row is cut short")
    table = np.loadtxt(
        io.StringIO(body),
        dtype=[(name, item.metadata["dtype"]) for name, item in columns.items()],
        delimiter=",",
        usecols=range(len(columns)),
        comments=None,
    )

    # The rows of a run begin with situations = 0, and all runs have equally many rows.
    runs = np.count_nonzero(table["situations"] == 0)
    if runs == 0 or table.size % runs:
        raise ValueError("a run lacks some of its evaluations")
    table = table.reshape(runs, -1)
    arrays = {}
    for name, item in columns.items():
        column, axes = table[name], item.metadata["axes"]
        if axes == (_RUN,):
            if np.any(column != column[:, :1]):
                raise ValueError(f"{name} changes within a run")
            column = column[:, 0]
        elif axes == (_EVALUATION,):
            if np.any(column != column[0]):
                raise ValueError("its runs were not all evaluated after the same situations")
            column = column[0]
        arrays[item.name] = column
    return Evaluations(**arrays, measure=measure)
