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
"""The `Path.glob` pattern of the temporary files that :func:`atomic_write` makes."""


@contextmanager
def atomic_write(path: Path, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a binary file for writing that appears at ``path`` only once it is complete.

    An earlier file at ``path`` is replaced when the block ends without an error. If the block or
    the writing fails, the earlier file stays and no temporary file is left. (A killed process may
    leave a hidden ``.tmp`` file: see :func:`clear_leftovers`.) The umask sets the permissions.

    Args:
        path: the file.
        durable: whether to wait until the data is on disk. If not, a power failure may leave the
            file empty; killing the process can't.

    Raises:
        OSError: if the directory is missing or read-only, or the disk is full; it names ``path``.
    """
    # The temporary file is in the same directory, because a rename is atomic only within a file
    # system. Python's tempfile isn't used: it ignores the umask and makes private files.
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
        # A write error names the temporary file or no file, so name the real file for the user.
        if error.errno is None or error.filename not in (None, str(temporary)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def clear_leftovers(directory: Path) -> None:
    """Remove the hidden files that :func:`atomic_write` leaves when its process is killed.

    No other process may be writing in the directory.
    """
    for leftover in directory.glob(_UNFINISHED):
        with suppress(OSError):  # it may belong to another user
            leftover.unlink()


@contextmanager
def alone_in(directory: Path) -> Iterator[None]:
    """Hold a lock on a directory during the block, if the file system has locks.

    Other processes wait for the lock. On Windows there is no lock.

    Raises:
        OSError: if there is no such directory.
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
