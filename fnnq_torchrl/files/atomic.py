"""Files that appear only once they are complete."""

import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

if sys.platform != "win32":
    import fcntl

_TOKEN_BYTES = 8
_UNFINISHED = ".*." + 2 * _TOKEN_BYTES * "[0-9a-f]" + ".tmp"
"""The names of files that are being written, as a pattern for `Path.glob`."""


@contextmanager
def atomic_write(path: Path, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a binary file that appears under ``path`` only once it is complete and on disk.

    An earlier file at ``path`` stays until the block has ended without an error. If the block or
    the writing fails, nothing is left behind. (A killed process may leave a hidden ``.tmp`` file:
    see :func:`clear_leftovers`.) The new file's permissions follow the umask.

    Args:
        path: the file.
        durable: wait for the disk. Without it, a power failure may leave the file empty; a killed
            process can't.

    Raises:
        OSError: the directory is missing or read-only, or the disk is full; names ``path``.
    """
    # In the same directory, since a rename is atomic only within a file system. Not by tempfile,
    # which ignores the umask and makes private files.
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(_TOKEN_BYTES)}.tmp")
    try:
        with open(temporary, "xb") as file:
            try:
                yield file
                file.flush()
                if durable:
                    os.fsync(file.fileno())
                os.replace(temporary, path)
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
    except OSError as error:
        # An error of writing names no file or the temporary one; the user needs the real name.
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def clear_leftovers(directory: Path) -> None:
    """Remove the hidden files that :func:`atomic_write` leaves when its process is killed.

    Nothing else may be writing in the directory.
    """
    for leftover in directory.glob(_UNFINISHED):
        with suppress(OSError):  # another user's
            leftover.unlink()


@contextmanager
def alone_in(directory: Path) -> Iterator[None]:
    """A block that only one process at a time runs for a directory, if the file system has locks.

    Raises:
        OSError: there is no such directory.
    """
    if sys.platform == "win32":
        yield
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        with suppress(OSError):  # the file system may have no locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
