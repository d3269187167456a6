"""Load the program of a step that was compiled before, without tracing the step again.

Tracing a step and writing its program takes seconds; loading a compiled program is much faster. So
the cache has a note for each recipe, with the name of the compiled library and the digest of its
content.
"""

import functools
import hashlib
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

import torch

import envs
from fnnq_torchrl.files.atomic import atomic_write

from .build import Run, build, cache_directory, compiling, libraries, library_of, load

_TRACING = ("torch", "tensordict", "torchrl", "numpy")
"""The libraries whose versions can change the traced program."""

_PACKAGES = (Path(envs.__file__).parent, Path(__file__).parents[2])
"""Our own packages, whose source code can change the traced program."""


def program(recipe: str | None, text: Callable[[], str]) -> Run:
    """Return the function ``run`` of a step's program; trace the step only if it isn't cached.

    A note or a library that is damaged, or that belongs to another user, is ignored.

    Args:
        recipe: the text that determines the step, together with the source code of our packages;
            None if the step must be traced.
        text: a function that traces the step and returns the text of its program.

    Raises:
        Exception: any exception of ``text`` or :func:`.build`.
    """
    if recipe is None:
        return build(text())
    note = cache_directory() / "steps" / _digest(recipe, *_surroundings())
    with suppress(OSError, ValueError, AttributeError):
        name, content = note.read_text(encoding="utf-8").split()
        library = libraries() / Path(name).name
        if _content(library) == content:
            return load(library)
    written = text()
    run, library = build(written), library_of(written)
    with suppress(OSError):  # the disk may be full; the step is then traced again
        note.parent.mkdir(mode=0o700, exist_ok=True)
        with atomic_write(note) as file:
            file.write(f"{library.name} {_content(library)}\n".encode())
    return run


def _surroundings() -> tuple[str, ...]:
    """Return texts that identify the code that traces the step, the compiler and the machine."""
    return (
        sys.version,
        *map(version, _TRACING),
        str(torch.get_default_dtype()),
        torch.backends.cpu.get_cpu_capability(),  # torch computes the step's constants
        compiling(),
        *(_sources(package) for package in _PACKAGES),
    )


@functools.cache
def _sources(package: Path) -> str:
    paths = sorted(package.rglob("*.py"))
    return _digest(*(f"{path.relative_to(package)} {_content(path)}" for path in paths))


def _content(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _digest(*texts: str) -> str:
    return hashlib.sha256(repr(texts).encode()).hexdigest()
