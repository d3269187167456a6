"""The learned weights of a job on disk: checkpoint.pt and snapshots.pt."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.files.plain import read_plain, write_plain

FORMAT = 1
"""The number of both files' format, raised when older files can no longer be read."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The weights that a job's runs have learned, as in checkpoint.pt.

    Raises:
        ValueError: on creation, if the first dimensions of a weight are not as stated below.
    """

    weights: dict[str, Tensor]  # by name, each [runs, ...], contiguous and on the CPU
    seed: Tensor  # [runs], int64
    lam: Tensor  # [runs], float64
    config: dict[str, Any]  # the resolved configuration, as plain values

    def __post_init__(self) -> None:
        if len(self.lam) != len(self.seed):
            raise ValueError(f"{len(self.seed)} seeds and {len(self.lam)} λ must be as many")
        for name, weight in self.weights.items():
            if weight.shape[: len(self._shape)] != self._shape:
                expected = ", ".join(map(str, self._shape))
                raise ValueError(f"{name} must be [{expected}, ...], not {[*weight.shape]}")

    @property
    def _shape(self) -> tuple[int, ...]:
        return (len(self.seed),)


@dataclass(frozen=True, eq=False)
class Snapshots(Checkpoint):
    """The weights of a job's runs at each evaluation, as in snapshots.pt.

    The weights are ``[evaluations, runs, ...]``; all else is as in a `Checkpoint`.
    """

    situations: Tensor  # [evaluations], int64: learning situations before each

    @property
    def _shape(self) -> tuple[int, ...]:
        return (len(self.situations), len(self.seed))


def save_checkpoint(
    path: Path,
    weights: TensorDictBase | Mapping[str, Tensor],
    seed: ArrayLike,
    lam: ArrayLike,
    config: dict[str, Any],
) -> None:
    """Write a checkpoint, atomically.

    Args:
        path: the file.
        weights: tensors ``[runs, ...]`` by name, of any layout and on any device; a nested
            TensorDict's names are joined by dots.
        seed: the seed of each run, ``[runs]``.
        lam: λ of each run, ``[runs]``.
        config: the resolved configuration, as values that JSON can hold.

    Raises:
        ValueError: the runs are not the first dimension of every tensor.
        TypeError: ``config`` holds other values.
        OSError: the file can't be written.
    """
    write_plain(path, FORMAT, vars(Checkpoint(*_plain(weights, seed, lam, config))))


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint back, onto the CPU.

    Raises:
        OSError: the file can't be read.
        ValueError: it is no checkpoint, is damaged, or is of another format. One line.
    """
    return Checkpoint(**_read(path, Checkpoint, "a checkpoint"))


def save_snapshots(
    path: Path,
    weights: TensorDictBase | Mapping[str, Tensor],
    situations: ArrayLike,
    seed: ArrayLike,
    lam: ArrayLike,
    config: dict[str, Any],
) -> None:
    """Write the weights at all evaluations, atomically.

    Args:
        path: the file.
        weights: tensors ``[evaluations, runs, ...]`` by name, of any layout and on any device.
        situations: learning situations before each evaluation, ``[evaluations]``.
        seed: the seed of each run, ``[runs]``.
        lam: λ of each run, ``[runs]``.
        config: the resolved configuration, as values that JSON can hold.

    Raises:
        ValueError: evaluations and runs are not the first dimensions of every tensor.
        TypeError: ``config`` holds other values.
        OSError: the file can't be written.
    """
    after = torch.from_numpy(np.array(situations, dtype=np.int64))
    write_plain(path, FORMAT, vars(Snapshots(*_plain(weights, seed, lam, config), after)))


def load_snapshots(path: Path) -> Snapshots:
    """Read snapshots back, onto the CPU.

    Raises:
        OSError: the file can't be read.
        ValueError: it holds no snapshots, is damaged, or is of another format. One line.
    """
    return Snapshots(**_read(path, Snapshots, "a file of snapshots"))


def _plain(
    weights: TensorDictBase | Mapping[str, Tensor],
    seed: ArrayLike,
    lam: ArrayLike,
    config: dict[str, Any],
) -> tuple[dict[str, Tensor], Tensor, Tensor, dict[str, Any]]:
    """Return the fields of a `Checkpoint`, in types that can be written and loaded again."""
    if isinstance(weights, TensorDictBase):
        weights = weights.flatten_keys(".").to_dict()
    return (
        # Copies, since a view would be saved with the whole tensor behind it.
        {
            name: weight.detach().to("cpu").clone(memory_format=torch.contiguous_format)
            for name, weight in weights.items()
        },
        torch.from_numpy(np.array(seed, dtype=np.int64)),
        torch.from_numpy(np.array(lam, dtype=np.float64)),
        json.loads(json.dumps(config)),
    )


def _read(path: Path, of: type[Checkpoint], what: str) -> dict[str, Any]:
    """Return the fields in a file; error messages call such a file ``what``."""
    content = read_plain(path, FORMAT, what)
    if content.keys() != {field.name for field in fields(of)}:
        raise ValueError(f"{path} is not {what}")
    return content
