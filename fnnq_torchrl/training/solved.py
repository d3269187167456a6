"""The file solved.csv: how close each run has come to the world's best mean reward.

It is written for worlds that state the best mean reward of a step, such as the ring.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase

from fnnq_torchrl.agent.watch import TOLD
from fnnq_torchrl.files.atomic import atomic_write

SOLVED = "solved.csv"
"""The name of the file."""

COLUMNS = ("seed", "situations", *TOLD)
"""Its columns: a row for each run and evaluation but the first, about the steps since the last.

``solved``, ``lowest``, ``later`` and ``above`` are those of :class:`.reward_means.Solution`.
"""


def is_watched(pages: TensorDictBase) -> bool:
    """Return whether a job's snapshots have what the file tells."""
    return all(key in pages.keys() for key in TOLD)  # noqa: SIM118  # it iterates over its rows


def write_solved(
    path: Path, seed: NDArray[np.int64], situations: NDArray[np.int64], pages: TensorDictBase
) -> None:
    """Write the file.

    Args:
        path: the file to write.
        seed: the seed of each run, ``[runs]``.
        situations: the number of situations before each evaluation, ``[evaluations]``.
        pages: the snapshots, ``[evaluations, runs]``.

    Raises:
        OSError: if the file can't be written.
    """
    told = [pages[key][1:].T.flatten().cpu().numpy() + 0 for key in TOLD]  # + 0: flags are 0 and 1
    later = situations[1:]
    columns = [np.repeat(seed, later.size), np.tile(later, seed.size), *told]
    rows = zip(*(column.tolist() for column in columns), strict=True)
    with atomic_write(path) as file:
        file.write((",".join(COLUMNS) + "\n").encode())
        file.writelines(f"{','.join(map(repr, row))}\n".encode() for row in rows)


def read_solved(path: Path) -> dict[str, NDArray[np.float64]]:
    """Read the file: its columns by name, each ``[runs, evaluations after the first]``.

    Raises:
        OSError: if the file can't be read.
        ValueError: if it isn't complete; the message names the file.
    """
    header, _, body = path.read_text(encoding="utf-8").partition("\n")
    try:
        if tuple(header.split(",")) != COLUMNS or not body.endswith("\n"):
            raise ValueError("it is cut short or has other columns")
        table = np.loadtxt(body.splitlines(), delimiter=",", ndmin=2)
        runs = np.count_nonzero(table[:, 1] == table[0, 1])
        return dict(zip(COLUMNS, table.T.reshape(len(COLUMNS), runs, -1), strict=True))
    except ValueError as error:
        raise ValueError(f"{path} is not a complete file of solved tasks: {error}") from error
