"""The directories that jobs and sweeps write to."""

import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def fresh_directory(path: str) -> str:
    """Make the directory ``path`` or, if it exists already, ``path_2``, ``path_3``, ….

    Two jobs that start within a second never share one: the system makes it for the first only.
    """
    name, number = path, 1
    while True:
        with suppress(FileExistsError):
            Path(name).mkdir(parents=True)
            return name
        number += 1
        name = f"{path}_{number}"


class OutputDirectory:
    """The directory of a job or a sweep, which can be put back to how it was.

    Args:
        path: need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._new = not path.exists() or (path.is_dir() and not any(path.iterdir()))
        self._before = {file: file.read_bytes() for file in self._configurations()}

    def restore(self) -> None:
        """Undo what Hydra has written. Files of results are never touched."""
        with suppress(OSError):
            if not self._new:
                for file in self._configurations():
                    if file in self._before:
                        file.write_bytes(self._before[file])
                return
            files = [file for file in self.path.rglob("*") if file.is_file()]
            if all(file.suffix in (".yaml", ".log") for file in files):
                for child in self.path.iterdir():
                    shutil.rmtree(child) if child.is_dir() else child.unlink()
                for empty in self._removable():
                    empty.rmdir()  # raises at the first that isn't empty

    def _configurations(self) -> Iterator[Path]:
        """Yield the files that Hydra overwrites."""
        yield from self.path.glob("multirun.yaml")
        yield from self.path.glob(".hydra/*.yaml")

    def _removable(self) -> Iterator[Path]:
        """Yield this directory, and upwards those above it within the current directory."""
        here, path = Path.cwd(), self.path.absolute()
        if path != here:
            yield path
        yield from (parent for parent in path.parents if here in parent.parents)
