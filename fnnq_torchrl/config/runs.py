"""The values that differ from run to run within a batch, as columns."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.config.schema import PER_RUN, Config


@dataclass(frozen=True, eq=False)
class Runs:
    """A table with a column for each key of `PER_RUN` and a row for each run.

    Attributes:
        columns: the columns by key, each ``[runs]``; ``seed`` is int64, the others are float64.
    """

    columns: dict[str, NDArray[Any]]

    @classmethod
    def of(cls, configs: Sequence[Config]) -> Self:
        """Return the runs of one or more jobs, in the order of the jobs.

        Args:
            configs: the jobs; a job's runs have the seeds ``seed … seed + num_seeds − 1``.
        """
        columns: dict[str, NDArray[Any]] = {
            "seed": np.concatenate(
                [each.seed + np.arange(each.num_seeds, dtype=np.int64) for each in configs]
            )
        }
        counts = [each.num_seeds for each in configs]
        for key in PER_RUN:
            if key != "seed":
                columns[key] = np.repeat([each.of_run(key) for each in configs], counts)
        return cls(columns)

    @property
    def bits(self) -> NDArray[np.int64]:
        """All numbers as int64 bit patterns, ``[runs, columns]``; a row identifies a run."""
        return np.stack([column.view(np.int64) for column in self.columns.values()], axis=-1)

    def rows_among(self, bits: NDArray[np.int64]) -> NDArray[np.int64] | None:
        """Find each run in another table; return row numbers, or None if a run is missing.

        Args:
            bits: :attr:`bits` of the other table. Each of its rows is used at most once.
        """
        places: dict[tuple[int, ...], list[int]] = defaultdict(list)
        for place, row in enumerate(bits.tolist()):
            places[tuple(row)].append(place)
        rows = []
        for row in self.bits.tolist():
            if not (there := places[tuple(row)]):
                return None
            rows.append(there.pop())
        return np.array(rows)

    def __len__(self) -> int:
        return self.columns["seed"].size

    def __getitem__(self, key: str) -> NDArray[Any]:
        return self.columns[key]
