"""Files of plain tensors and plain values, which can run no code."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import torch
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.files.atomic import atomic_write


def write_plain(path: Path, form: int, content: dict[str, Any]) -> None:
    """Write a file, atomically.

    Args:
        path: the file.
        form: the number of its format.
        content: tensors, numbers, texts, and lists, tuples and dictionaries of them.

    Raises:
        OSError: it can't be written.
    """
    # Not into the file: torch.save would make a RuntimeError of a full disk.
    data = io.BytesIO()
    torch.save({"format": form, **content}, data)
    with atomic_write(path) as file:
        file.write(data.getbuffer())


def read_plain(path: Path, form: int, what: str) -> dict[str, Any]:
    """Read such a file back, onto the CPU.

    Args:
        path: the file.
        form: the number of the format that it must have.
        what: it should be, for the message if it isn't, with its article.

    Raises:
        OSError: it can't be read.
        ValueError: it is something else, not whole, or of another format. One line.
    """
    data = path.read_bytes()
    try:
        # Torch's reader passes over the checksums that torch's writer gives every entry.
        if damaged := ZipFile(io.BytesIO(data)).testzip():
            raise ValueError(f"{damaged} is damaged")
        content = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    # Bytes from anywhere make torch's reader raise nearly anything: EOFError, KeyError, ...
    except Exception as error:
        raise ValueError(f"{path} is not {what}, or a damaged one") from error
    if not isinstance(content, dict) or "format" not in content:
        raise ValueError(f"{path} is not {what} of fnnq_torchrl")
    version = content.pop("format")
    if type(version) is not int or version != form:
        kind = what.split()[-1]
        raise ValueError(f"{path} has {kind} format {version}, and this program reads {form}")
    return content


def plain_weights(weights: TensorDictBase | Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Copies of tensors by name, each in contiguous memory of its own on the CPU.

    A mere view would be saved with all that it views.

    Args:
        weights: of any layout and on any device; a nested TensorDict's names are joined by dots.
    """
    if isinstance(weights, TensorDictBase):
        weights = weights.flatten_keys(".").to_dict()
    return {
        name: weight.detach().to("cpu").clone(memory_format=torch.contiguous_format)
        for name, weight in weights.items()
    }


def plain_values(values: dict[str, Any]) -> dict[str, Any]:
    """The same values, of what a JSON file can hold.

    Raises:
        TypeError: one is no such value, and could be written but not loaded.
    """
    plain: dict[str, Any] = json.loads(json.dumps(values))
    return plain
