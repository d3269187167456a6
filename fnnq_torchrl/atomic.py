"""Files that are there whole or not at all."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def atomic_write(path: Path) -> Iterator[BinaryIO]:
    """Open a binary file that appears under ``path`` only once it is complete and on disk.

    Until the block ends well, an earlier file at ``path`` stays as it was; if the block or the
    writing fails, nothing is left behind. (A killed process may leave a hidden ``.tmp`` file.)
    The new file's permissions follow the umask.

    Raises:
        OSError: the directory is missing or read-only, or the disk is full.
    """
    # In the same directory, since a rename is atomic within one file system only. Not tempfile,
    # whose files are private to the user whatever the umask.
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(8)}.tmp")
    with open(temporary, "xb") as file:
        try:
            yield file
            file.flush()
            os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
