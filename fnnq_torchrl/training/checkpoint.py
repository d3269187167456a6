"""The learned weights on disk: plain tensors and plain values, which can run no code."""

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
class Checkpoint:
    """What checkpoint.pt holds, on the CPU.

    Raises:
        ValueError: on creation, if a shape or dtype is not as stated below.
    """

    weights: dict[str, Tensor]  # each [runs, ...] and contiguous
    seed: Tensor  # [runs], int64
    lam: Tensor  # [runs], float64
    config: dict[str, Any]  # plain values: what a JSON file could hold

    def __post_init__(self) -> None:
        runs = self.seed.shape
        if len(runs) != 1 or self.lam.shape != runs:
            raise ValueError(
                "seed and lam must both be [runs], "
                f"got {list(self.seed.shape)} and {list(self.lam.shape)}"
            )
        if self.seed.dtype != torch.int64 or self.lam.dtype != torch.float64:
            raise ValueError(
                f"seed must be int64 and lam float64, got {self.seed.dtype} and {self.lam.dtype}"
            )
        if not isinstance(self.config, dict):
            raise ValueError(f"config must be a dictionary, got {type(self.config).__name__}")
        for name, weight in self.weights.items():
            if weight.shape[:1] != runs:
                raise ValueError(
                    f"weights {name!r} must be [{runs[0]} runs, ...], got {list(weight.shape)}"
                )


def save_checkpoint(
    path: Path,
    weights: TensorDictBase | Mapping[str, Tensor],
    seed: ArrayLike,
    lam: ArrayLike,
    config: dict[str, Any],
) -> None:
    """Write a checkpoint.

    Args:
        path: the file to write, atomically.
        weights: tensors ``[runs, ...]`` by name, of any layout and on any device; a nested
            TensorDict's names are joined by dots.
        seed: of each run, ``[runs]``.
        lam: of each run, ``[runs]``.
        config: the resolved configuration, as plain values.

    Raises:
        ValueError: a tensor has not the runs as its first dimension.
        TypeError: ``config`` holds something else than plain values.
    """
    checkpoint = Checkpoint(
        weights=plain_weights(weights),
        seed=torch.from_numpy(np.array(seed, dtype=np.int64)),
        lam=torch.from_numpy(np.array(lam, dtype=np.float64)),
        config=plain_values(config),
    )
    write_plain(path, FORMAT, vars(checkpoint))


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint back, onto the CPU.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a checkpoint, not a whole one, or of another format. One line.
    """
    content = read_plain(path, FORMAT, "a checkpoint")
    try:
        return Checkpoint(**content)
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is not a complete checkpoint: {error}") from error
