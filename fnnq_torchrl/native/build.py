"""From a program's text to a function that can be called."""

import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fnnq_torchrl.atomic import atomic_write
from fnnq_torchrl.config import ConfigError

_FLAGS = (
    "-std=c++17 -O1 -ftree-vectorize -fopenmp-simd -shared -fPIC -w "
    # Each operation is rounded once, as in torch, whatever stands beside it.
    "-ffp-contract=off -fwrapv -fno-math-errno -fno-trapping-math "
)
_FLAGS += (
    "-march=native -mprefer-vector-width=256"
    if platform.machine() in ("x86_64", "AMD64")
    else "-mcpu=native"
)


def compiler() -> str:
    """The C++ compiler that CXX names, or the system's."""
    return os.environ.get("CXX") or ("clang++" if sys.platform == "darwin" else "g++")


def compiler_found() -> bool:
    """Whether that compiler is there."""
    return shutil.which(compiler()) is not None


def cache_directory() -> Path:
    """Where programs are kept, for later jobs to find them."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "fnnq_torchrl"


def build(text: str) -> Callable[..., Any]:
    """The function ``run`` of a C++ program.

    While it runs, other threads of Python's go on.

    Raises:
        ConfigError: there is no compiler, or it fails.
        OSError: the cache can't be written.
    """
    digest = hashlib.sha256(f"{_target(compiler())}\n{_FLAGS}\n{text}".encode()).hexdigest()
    library = cache_directory() / "native" / f"{digest[:32]}.so"
    if not library.exists():
        library.parent.mkdir(parents=True, exist_ok=True)
        # Other jobs may be at the same program: each writes a file of its own, one of them stays.
        with atomic_write(library) as file:
            _compile(["-x", "c++", *_FLAGS.split(), "-", "-o", file.name], text)
    run = ctypes.CDLL(str(library)).run
    run.argtypes = [ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p]
    run.restype = None
    return run


@functools.cache
def _target(compiler: str) -> str:
    """What the compiler is and what it compiles for: a cache may be shared by several machines."""
    return _compile([*_FLAGS.split(), "-dM", "-E", "-x", "c++", os.devnull], "")


def _compile(arguments: list[str], text: str) -> str:
    try:
        done = subprocess.run(
            [compiler(), *arguments], input=text, text=True, capture_output=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        said = getattr(error, "stderr", None) or str(error)
        first = next((line for line in said.splitlines() if "rror" in line), said.splitlines()[-1])
        raise ConfigError(
            f"engine=compiled: the C++ compiler doesn't work; engine=eager takes none. "
            f"It says: {first}"
        ) from error
    return done.stdout
