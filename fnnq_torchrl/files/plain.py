"""Files of tensors, numbers and texts. Reading a file runs no code from it."""

import io
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, ZipFile

import torch

from fnnq_torchrl.files.atomic import atomic_write


def write_plain(path: Path, form: int, content: dict[str, Any]) -> None:
    """Write tensors, numbers and texts to a file atomically.

    Args:
        path: the file.
        form: the number of the file's format.
        content: tensors, numbers, texts, and lists, tuples and dictionaries of them.

    Raises:
        OSError: if the file can't be written.
    """
    # Save to memory first: writing to a full disk, torch.save would raise a RuntimeError.
    data = io.BytesIO()
    torch.save({"format": form, **content}, data)
    with atomic_write(path) as file:
        file.write(data.getbuffer())


def read_plain(path: Path, form: int, what: str) -> dict[str, Any]:
    """Read a file of :func:`write_plain`, with the tensors on the CPU.

    Args:
        path: the file.
        form: the number of the format that the file must have.
        what: a noun for the file with its article, for the error, as in "a training".

    Raises:
        OSError: if the file can't be read.
        ValueError: if the file is damaged, has another format, or isn't a file of
            :func:`write_plain`; the message is one line.
    """
    data = path.read_bytes()
    try:
        # torch.save writes a checksum for every entry, but torch.load doesn't check it.
        archive = ZipFile(io.BytesIO(data))
        if any(entry.compress_type != ZIP_STORED for entry in archive.infolist()):
            raise ValueError("compressed entries, which may be far larger than the file")
        if damaged := archive.testzip():
            raise ValueError(f"{damaged} is damaged")
        content = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    # For arbitrary bytes torch.load may raise nearly any error: EOFError, KeyError, …
    except Exception as error:
        raise ValueError(f"{path} is damaged, or not {what}") from error
    if not isinstance(content, dict) or "format" not in content:
        raise ValueError(f"{path} is not {what} of fnnq_torchrl")
    if (found := content.pop("format")) != form:
        raise ValueError(f"{path} is {what} of format {found}, and this program reads {form}")
    return content
