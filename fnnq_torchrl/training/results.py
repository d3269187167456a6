"""A finished job's numbers, and the two files that hold them: evaluations.csv, summary.json."""

import io
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from types import UnionType
from typing import Any, Self, TypedDict, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.intervals import mean_interval

# The columns of evaluations.csv. They stay first and in this order for good.
EVALUATION_COLUMNS = ("seed", "lam", "situations", "steps", "catches", "diverged", "denormal")
_ALWAYS = 5  # of them; files from before there were the others, which are flags, are read too
CONFIDENCE = 0.95
# The final score is the mean over this many last evaluations.
FINAL_EVALUATIONS = 8

_DTYPES = {
    name: np.dtype({"lam": "f8", "diverged": "?", "denormal": "?"}.get(name, "i8"))
    for name in EVALUATION_COLUMNS
}


@dataclass(frozen=True, eq=False)
class Evaluations:
    """What evaluations.csv holds: the scores of all runs, all evaluated at the same moments.

    Raises:
        ValueError: on creation, if a shape or dtype is not as stated below, the first evaluation
            is not the one before learning, or there is no other.
    """

    seed: NDArray[np.int64]  # [runs]
    lam: NDArray[np.float64]  # [runs]
    situations: NDArray[np.int64]  # [evaluations], learning situations before each; starts at 0
    steps: NDArray[np.int64]  # [runs, evaluations], learning steps of the run so far
    catches: NDArray[np.int64]  # [runs, evaluations], the score: situations that end in a catch
    diverged: NDArray[np.bool_]  # [runs, evaluations], whether the run had; it then has no catch
    denormal: NDArray[np.bool_]  # [runs, evaluations], whether some weights are subnormal numbers

    def __post_init__(self) -> None:
        runs, evaluations = self.seed.size, self.situations.size
        shapes = ((runs,), (runs,), (evaluations,), *[(runs, evaluations)] * 4)
        for name, shape in zip(EVALUATION_COLUMNS, shapes, strict=True):
            array = getattr(self, name)
            if array.shape != shape or array.dtype != _DTYPES[name]:
                raise ValueError(
                    f"{name} must be {_DTYPES[name]} {list(shape)}, "
                    f"got {array.dtype} {list(array.shape)}"
                )
        if runs == 0:
            raise ValueError("there must be at least one run")
        if evaluations < 2 or self.situations[0] != 0 or np.any(np.diff(self.situations) <= 0):
            raise ValueError(
                "situations must be 0 at the first evaluation and rise at each of the others, "
                f"of which there must be one; got {self.situations.tolist()}"
            )

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return self.seed.size

    @property
    def learning_steps(self) -> int:
        """Learning steps of all runs together."""
        return int(self.steps[:, -1].sum())

    @property
    def diverged_runs(self) -> int:
        """How many runs have diverged."""
        return int(self.diverged[:, -1].sum())

    @property
    def denormal_runs(self) -> int:
        """How many runs have learned weights too small for full precision."""
        return int(self.denormal[:, -1].sum())

    @property
    def mean_score(self) -> NDArray[np.float64]:
        """Mean score of each run after learning began, so without its first: ``[runs]``."""
        return self.catches[:, 1:].mean(axis=1)

    @property
    def final_score(self) -> NDArray[np.float64]:
        """Mean score of each run over its last ``FINAL_EVALUATIONS`` of those: ``[runs]``."""
        return self.catches[:, 1:][:, -FINAL_EVALUATIONS:].mean(axis=1)


@dataclass(frozen=True, eq=False)
class Outcome(Evaluations):
    """Finished runs: their evaluations, and the wall time that their batch took, part by part.

    A batch is what was trained together: a job's runs, or those of several jobs.
    """

    batch_runs: int
    batch_learning_steps: int  # of all its runs together
    train_seconds: float  # learning, without the two below
    compile_seconds: float
    evaluate_seconds: float

    def of(self, runs: slice) -> Self:
        """What came of some of the runs; the batch stays the one they were in."""
        return replace(
            self,
            seed=self.seed[runs],
            lam=self.lam[runs],
            steps=self.steps[runs],
            catches=self.catches[runs],
            diverged=self.diverged[runs],
            denormal=self.denormal[runs],
        )


class Summary(TypedDict):
    """The keys of summary.json, in their order. Scores are catches; intervals are [low, high]."""

    runs: int
    diverged_runs: int  # they count as catching nothing from then on
    lam: list[float]  # the distinct values, rising
    learning_steps: int  # of all runs together
    # Of the batch: jobs that were trained together share these.
    batch_runs: int
    train_seconds: float
    compile_seconds: float
    evaluate_seconds: float
    learning_steps_per_second: float | None  # null if no time was measured
    mean_score: float
    mean_score_interval: list[float] | None  # null for a single run, which has none
    final_score: float
    final_score_interval: list[float] | None
    confidence: float
    denormal_runs: int  # with subnormal numbers among the learned weights


def summarise(outcome: Outcome) -> Summary:
    """The job in a few numbers: means over its runs and Student's t intervals of those means."""
    mean_score, mean_score_interval = _mean_over_runs(outcome.mean_score)
    final_score, final_score_interval = _mean_over_runs(outcome.final_score)
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
        mean_score=mean_score,
        mean_score_interval=mean_score_interval,
        final_score=final_score,
        final_score_interval=final_score_interval,
        confidence=CONFIDENCE,
        denormal_runs=outcome.denormal_runs,
    )


def _mean_over_runs(samples: NDArray[np.float64]) -> tuple[float, list[float] | None]:
    """Mean of the samples, ``[runs]``, and its interval where there is one."""
    mean, low, high = mean_interval(samples, confidence=CONFIDENCE)
    return float(mean), None if samples.size == 1 else [float(low), float(high)]


def write_summary(path: Path, summary: Summary) -> None:
    """Write summary.json.

    Raises:
        ValueError: a value is NaN or infinite, which JSON cannot hold.
    """
    text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
    with atomic_write(path) as file:
        file.write(text.encode())


def read_summary(path: Path) -> Summary:
    """Read summary.json back.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a summary.json; the message names the file.
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
    """Whether a value read from JSON is of one of the types of a `Summary`."""
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
    # Python's own numbers, since formatting NumPy's is several times slower.
    situations = evaluations.situations.tolist()
    of_each_run = (
        evaluations.seed,
        evaluations.lam,
        evaluations.steps,
        evaluations.catches,
        evaluations.diverged.astype(int),
        evaluations.denormal.astype(int),
    )
    for seed, lam, *columns in zip(*(a.tolist() for a in of_each_run), strict=True):
        run = f"{seed},{lam!r}"  # repr is the shortest text that reads back exactly
        rows = zip(situations, *columns, strict=True)
        yield "".join(f"{run},{a},{b},{c},{d},{e}\n" for a, b, c, d, e in rows).encode()


def read_evaluations(path: Path) -> Evaluations:
    """Read evaluations.csv back, exactly. Columns after the known ones are passed over.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not an evaluations.csv, or not a whole one; the message names the file.
    """
    try:
        return _parse_evaluations(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} is not a complete evaluations file: {error}") from error


def _parse_evaluations(text: str) -> Evaluations:
    header, _, body = text.partition("\n")
    pairs = zip(EVALUATION_COLUMNS, header.split(","), strict=False)
    known = [name for name, _ in takewhile(lambda pair: pair[0] == pair[1], pairs)]
    if len(known) < _ALWAYS:
        raise ValueError(f"its columns must begin {','.join(EVALUATION_COLUMNS)}")
    if not body.strip():
        raise ValueError("it has no rows")
    if not body.endswith("\n"):
        raise ValueError("its last row is cut short")
    table = np.loadtxt(
        io.StringIO(body),
        dtype=[(name, _DTYPES[name]) for name in known],
        delimiter=",",
        usecols=range(len(known)),
        comments=None,
    )

    # Every run begins at its evaluation before learning, and all have the same evaluations.
    runs = np.count_nonzero(table["situations"] == 0)
    if runs == 0 or table.size % runs:
        raise ValueError("some run lacks some of its evaluations")
    table = table.reshape(runs, -1)
    if np.any(table["situations"] != table["situations"][0]):
        raise ValueError("its runs were not all evaluated after the same situations")
    for column in ("seed", "lam"):
        if np.any(table[column] != table[column][:, :1]):
            raise ValueError(f"{column} changes within a run")
    return Evaluations(
        seed=table["seed"][:, 0],
        lam=table["lam"][:, 0],
        situations=table["situations"][0],
        steps=table["steps"],
        catches=table["catches"],
        **{
            flag: table[flag] if flag in known else np.zeros(table.shape, dtype=bool)
            for flag in EVALUATION_COLUMNS[_ALWAYS:]
        },
    )
