"""Files that are there whole or not at all."""

import os
import re
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

if sys.platform != "win32":
    import fcntl

_TEMPORARY = re.compile(r"\..+\.[0-9a-f]{16}\.tmp")
"""The names of files that aren't complete."""


@contextmanager
def atomic_write(path: Path, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a binary file that appears under ``path`` only once it is complete and on disk.

    Until the block ends well, an earlier file at ``path`` stays as it was; if the block or the
    writing fails, nothing is left behind. (A killed process may leave a hidden ``.tmp`` file: see
    :func:`clear_leftovers`.) The new file's permissions follow the umask.

    Args:
        path: the file.
        durable: wait for the disk, lest a power failure leave the file empty; a mere kill doesn't.

    Raises:
        OSError: the directory is missing or read-only, or the disk is full; names ``path``.
    """
    # In the same directory, since a rename is atomic within one file system only. Not tempfile,
    # whose files are private to the user whatever the umask.
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(8)}.tmp")  # see _TEMPORARY
    try:
        with open(temporary, "xb") as file:
            try:
                with suppress(OSError):  # a file system may know no locks
                    _lock(file)
                yield file
                file.flush()
                if durable:
                    os.fsync(file.fileno())
                os.replace(temporary, path)
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise
    except OSError as error:
        # Writing names no file, and the temporary one tells the user nothing.
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def clear_leftovers(directory: Path) -> None:
    """Remove the hidden files that killed processes have left of :func:`atomic_write`.

    Those that a living process is writing are locked by it, and stay.
    """
    for leftover in directory.glob(".*.tmp"):
        if _TEMPORARY.fullmatch(leftover.name) is None:
            continue
        try:
            with open(leftover, "rb") as file:
                _lock(file)
                leftover.unlink()
        except OSError:  # it is being written, is somebody else's, or is gone
            continue


@contextmanager
def alone_in(directory: Path) -> Iterator[None]:
    """A block that no two processes are in for the same directory, where its file system can tell.

    Raises:
        OSError: there is no such directory.
    """
    if sys.platform == "win32":
        yield
        return
    handle = os.open(directory, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system may know no locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _lock(file: BinaryIO) -> None:
    """For as long as the file is open, and the process lives.

    Raises:
        OSError: somebody else has it, or the file system knows no locks.
    """
    if sys.platform != "win32":  # which lets nobody remove a file that is open
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
