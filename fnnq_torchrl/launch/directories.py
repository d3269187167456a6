"""The directories that jobs and sweeps write to."""

import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def fresh_directory(path: str) -> str:
    """Make the directory ``path`` or, if it exists, ``path_2``, ``path_3``, …; return its name.

    Two jobs that start at the same time get different directories, because only one of them can
    make a directory.
    """
    name, number = path, 1
    while True:
        with suppress(FileExistsError):
            Path(name).mkdir(parents=True)
            return name
        number += 1
        name = f"{path}_{number}"


class OutputDirectory:
    """The directory of a job or a sweep, which can be restored to its earlier state.

    Args:
        path: the directory, which need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._new = not path.exists() or (path.is_dir() and not any(path.iterdir()))
        self._before = {file: file.read_bytes() for file in self._configurations()}

    def restore(self) -> None:
        """Remove or restore the files that Hydra has written. Result files are never touched."""
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
                    empty.rmdir()  # stops with an error at the first that isn't empty

    def _configurations(self) -> Iterator[Path]:
        """Yield the existing files that Hydra would overwrite."""
        yield from self.path.glob("multirun.yaml")
        yield from self.path.glob(".hydra/*.yaml")

    def _removable(self) -> Iterator[Path]:
        """Yield this directory, then those of its parents that are in the current directory."""
        here, path = Path.cwd(), self.path.absolute()
        if path != here:
            yield path
        yield from (parent for parent in path.parents if here in parent.parents)
