"""Files of tensors, numbers and texts; reading one runs no code from it."""

import io
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import torch

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
        what: the noun for such a file, with its article, for the error.

    Raises:
        OSError: it can't be read.
        ValueError: it is something else, damaged, or of another format; the text is one line.
    """
    data = path.read_bytes()
    try:
        # Torch writes a checksum with every entry, but doesn't check it when reading.
        if damaged := ZipFile(io.BytesIO(data)).testzip():
            raise ValueError(f"{damaged} is damaged")
        content = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    # On arbitrary bytes torch's reader raises nearly any error: EOFError, KeyError, …
    except Exception as error:
        raise ValueError(f"{path} is damaged, or not {what}") from error
    if not isinstance(content, dict) or "format" not in content:
        raise ValueError(f"{path} is not {what} of fnnq_torchrl")
    if (found := content.pop("format")) != form:
        raise ValueError(f"{path} is {what} of format {found}, and this program reads {form}")
    return content
