"""The file firing.csv: each rule's firing strength, summed over the steps of learning."""

import csv
import io
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from fnnq_torchrl.agent.rules import Variable
from fnnq_torchrl.files.atomic import atomic_write

FIRING = "firing.csv"
"""The name of the file, which a job writes with ``rules.count_firing=true``."""


def write_firing(
    path: Path, seeds: Sequence[int], fired: Tensor, variables: Sequence[Variable]
) -> None:
    """Write a row for each run and rule: the seed, the rule's labels, and its summed strength.

    Args:
        path: the file to write.
        seeds: the seed of each run.
        fired: the summed strengths, ``[runs, labels of input 1, …, action labels]``.
        variables: the state inputs and, last, the action.

    Raises:
        OSError: if the file can't be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["seed", *(variable.name for variable in variables), "fired"])
    rules = [*product(*(variable.names for variable in variables))]
    for seed, strengths in zip(seeds, fired.flatten(1).tolist(), strict=True):
        writer.writerows(
            [seed, *labels, strength] for labels, strength in zip(rules, strengths, strict=True)
        )
    with atomic_write(path) as file:
        file.write(text.getvalue().encode())


def read_firing(path: Path, shape: Sequence[int]) -> Tensor:
    """Read the summed strengths that `write_firing` wrote.

    Args:
        path: the file to read.
        shape: the shape of the result, ``[runs, labels of input 1, …, action labels]``.

    Raises:
        OSError: if the file can't be read.
        ValueError: if the file has another format or another number of rules. One line.
    """
    rows = path.read_text(encoding="utf-8").splitlines()[1:]
    try:
        numbers = np.array([float(row.rpartition(",")[2]) for row in rows])
        return torch.from_numpy(numbers).reshape(*shape)
    except (ValueError, RuntimeError):
        raise ValueError(f"{path} is not a file of the firing strengths of these runs") from None
