"""The weights of all evaluations on disk, as :mod:`.checkpoint` has the last."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.files.plain import plain_values, plain_weights, read_plain, write_plain

FORMAT = 1


@dataclass(frozen=True, eq=False)
class Snapshots:
    """What snapshots.pt holds, on the CPU.

    Raises:
        ValueError: on creation, if a shape or dtype is not as stated below.
    """

    weights: dict[str, Tensor]  # each [evaluations, runs, ...] and contiguous
    situations: Tensor  # [evaluations], int64: learning situations before each
    seed: Tensor  # [runs], int64
    lam: Tensor  # [runs], float64
    config: dict[str, Any]  # plain values: what a JSON file could hold

    def __post_init__(self) -> None:
        shape = (*self.situations.shape, *self.seed.shape)
        if self.situations.ndim != 1 or self.seed.ndim != 1 or self.lam.shape != self.seed.shape:
            raise ValueError(
                "situations must be [evaluations], seed and lam [runs], got "
                f"{list(self.situations.shape)}, {list(self.seed.shape)}, {list(self.lam.shape)}"
            )
        dtypes = (self.situations.dtype, self.seed.dtype, self.lam.dtype)
        if dtypes != (torch.int64, torch.int64, torch.float64):
            raise ValueError(
                "situations and seed must be int64 and lam float64, "
                f"got {', '.join(map(str, dtypes))}"
            )
        for name, weight in self.weights.items():
            if weight.shape[:2] != shape:
                raise ValueError(
                    f"weights {name!r} must be [{shape[0]} evaluations, {shape[1]} runs, ...], "
                    f"got {list(weight.shape)}"
                )


def save_snapshots(
    path: Path,
    weights: TensorDictBase | Mapping[str, Tensor],
    situations: ArrayLike,
    seed: ArrayLike,
    lam: ArrayLike,
    config: dict[str, Any],
) -> None:
    """Write snapshots.

    Args:
        path: the file to write, atomically.
        weights: tensors ``[evaluations, runs, ...]`` by name, of any layout and on any device.
        situations: learning situations before each evaluation, ``[evaluations]``.
        seed: of each run, ``[runs]``.
        lam: of each run, ``[runs]``.
        config: the resolved configuration, as plain values.

    Raises:
        ValueError: a tensor has not the evaluations and the runs as its first dimensions.
        TypeError: ``config`` holds something else than plain values.
        OSError: the file can't be written.
    """
    snapshots = Snapshots(
        weights=plain_weights(weights),
        situations=torch.from_numpy(np.array(situations, dtype=np.int64)),
        seed=torch.from_numpy(np.array(seed, dtype=np.int64)),
        lam=torch.from_numpy(np.array(lam, dtype=np.float64)),
        config=plain_values(config),
    )
    write_plain(path, FORMAT, vars(snapshots))


def load_snapshots(path: Path) -> Snapshots:
    """Read snapshots back, onto the CPU.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no such file, not a whole one, or of another format. One line.
    """
    content = read_plain(path, FORMAT, "a file of snapshots")
    try:
        return Snapshots(**content)
    except (AttributeError, IndexError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is not a complete file of snapshots: {error}") from error
