"""The files with the learned weights of a job: checkpoint.pt and snapshots.pt."""

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
"""The format number of both files, raised when older files can no longer be read."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The content of checkpoint.pt: the weights that the runs of a job have learned.

    Raises:
        ValueError: on creation, if the first dimensions of a weight are not as stated below.
    """

    weights: dict[str, Tensor]  # by name, each [runs, ...], contiguous and on the CPU
    seed: Tensor  # [runs], int64
    lam: Tensor  # [runs], float64
    config: dict[str, Any]  # the resolved configuration, as plain values

    def __post_init__(self) -> None:
        if len(self.lam) != len(self.seed):
            raise ValueError(f"{len(self.seed)} seeds and {len(self.lam)} λ must be equally many")
        for name, weight in self.weights.items():
            if weight.shape[: len(self._shape)] != self._shape:
                expected = ", ".join(map(str, self._shape))
                raise ValueError(f"{name} must be [{expected}, ...], not {[*weight.shape]}")

    @property
    def _shape(self) -> tuple[int, ...]:
        return (len(self.seed),)


@dataclass(frozen=True, eq=False)
class Snapshots(Checkpoint):
    """The content of snapshots.pt: the weights of the runs of a job at each evaluation.

    Each weight is ``[evaluations, runs, ...]``; the other fields are as in `Checkpoint`.
    """

    situations: Tensor  # [evaluations], int64: learning situations before each one

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
        weights: tensors ``[runs, ...]`` by name, of any layout and on any device. The names in a
            nested TensorDict are joined by dots.
        seed: the seed of each run, ``[runs]``.
        lam: λ of each run, ``[runs]``.
        config: the resolved configuration, as values that JSON can hold.

    Raises:
        ValueError: if the runs are not the first dimension of every tensor.
        TypeError: if JSON can't hold a value of ``config``.
        OSError: if the file can't be written.
    """
    write_plain(path, FORMAT, vars(Checkpoint(*_plain(weights, seed, lam, config))))


def load_checkpoint(path: Path) -> Checkpoint:
    """Read checkpoint.pt, with its tensors on the CPU.

    Raises:
        OSError: if the file can't be read.
        ValueError: if the file isn't a checkpoint, is damaged, or has another format. The message
            is one line.
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
    """Write snapshots.pt, the weights at all evaluations, atomically.

    Args:
        path: the file.
        weights: tensors ``[evaluations, runs, ...]`` by name, of any layout and on any device.
        situations: learning situations before each evaluation, ``[evaluations]``.
        seed: the seed of each run, ``[runs]``.
        lam: λ of each run, ``[runs]``.
        config: the resolved configuration, as values that JSON can hold.

    Raises:
        ValueError: if evaluations and runs are not the first dimensions of every tensor.
        TypeError: if JSON can't hold a value of ``config``.
        OSError: if the file can't be written.
    """
    after = torch.from_numpy(np.array(situations, dtype=np.int64))
    write_plain(path, FORMAT, vars(Snapshots(*_plain(weights, seed, lam, config), after)))


def load_snapshots(path: Path) -> Snapshots:
    """Read snapshots.pt, with its tensors on the CPU.

    Raises:
        OSError: if the file can't be read.
        ValueError: if the file doesn't hold snapshots, is damaged, or has another format. The
            message is one line.
    """
    return Snapshots(**_read(path, Snapshots, "a file of snapshots"))


def _plain(
    weights: TensorDictBase | Mapping[str, Tensor],
    seed: ArrayLike,
    lam: ArrayLike,
    config: dict[str, Any],
) -> tuple[dict[str, Tensor], Tensor, Tensor, dict[str, Any]]:
    """Return the fields of a `Checkpoint`, converted to the types that the file holds."""
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
    """Return the fields of class ``of`` from a file; ``what`` is its noun in error messages."""
    content = read_plain(path, FORMAT, what)
    if content.keys() != {field.name for field in fields(of)}:
        raise ValueError(f"{path} is not {what}")
    return content
