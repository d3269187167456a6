"""Compile a C++ program, cache it and load its function."""

import ctypes
import functools
import hashlib
import logging
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.files.atomic import atomic_write

_log = logging.getLogger(__name__)

_FLAGS = (
    "-std=c++17 -O1 -ftree-vectorize -fopenmp-simd -shared -fPIC -w "
    # No fused multiply-add: each operation is rounded once, as in torch.
    "-ffp-contract=off -fwrapv -fno-math-errno -fno-trapping-math "
)
_FLAGS += (
    "-march=native -mprefer-vector-width=512"
    if platform.machine() in ("x86_64", "AMD64")
    else "-mcpu=native"
)


Run = Callable[..., None]
"""The function of a native program: see :data:`.prelude.RUN`."""


def compiler() -> str:
    """Return the C++ compiler's command: that of CXX, which may have options, or the default."""
    return os.environ.get("CXX") or ("clang++" if sys.platform == "darwin" else "g++")


def compiler_found() -> bool:
    """Return whether the compiler exists and preprocesses an empty file, which is a fast check."""
    if shutil.which(shlex.split(compiler())[0]) is None:
        return False
    try:
        _target(compiler())
    except ConfigError:
        return False
    return True


def cache_directory() -> Path:
    """Return the directory that caches compiled programs for later jobs.

    If the user's cache isn't writable, it is a temporary directory of this process.
    """
    home = os.environ.get("XDG_CACHE_HOME", "")
    return _writable(home if Path(home).is_absolute() else "~/.cache")


@functools.cache
def _writable(home: str) -> Path:
    try:
        directory = Path(home).expanduser() / "fnnq_torchrl"
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return directory
    except (OSError, RuntimeError) as error:  # without a home there is no ~
        _log.info(
            "compiled programs aren't cached: %s; set XDG_CACHE_HOME to a writable directory", error
        )
        return Path(_for_this_process().name)


@functools.cache
def _for_this_process() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="fnnq_torchrl_")


def build(text: str) -> Run:
    """Return the function ``run`` of a C++ program, compiling the program if it isn't cached.

    The function releases the GIL.

    Raises:
        ConfigError: if there is no compiler, it fails, or its library can't be loaded.
        OSError: if the library can't be written, for example on a full disk.
    """
    library = library_of(text)
    if not library.exists():
        _make(library, text)
    try:
        return load(library)
    except (OSError, AttributeError):  # damaged, or built on another machine
        _make(library, text)
    try:
        return load(library)
    except OSError as error:
        raise ConfigError(f"engine=compiled: {error}; engine=eager loads nothing") from error


def library_of(text: str) -> Path:
    """Return the place of a program's library in the cache; it may not exist."""
    digest = hashlib.sha256(f"{compiling()}\n{text}".encode()).hexdigest()
    return libraries() / f"{digest[:32]}.so"


def libraries() -> Path:
    """Return the directory of the programs' libraries."""
    return cache_directory() / "native"


def compiling() -> str:
    """Return what else than a program's text determines its library: compiler, machine, flags."""
    return f"{_target(compiler())}\n{_FLAGS}"


def load(library: Path) -> Run:
    """Return the function ``run`` of a library.

    Raises:
        OSError: if the library can't be loaded.
        AttributeError: if it has no function of that name.
    """
    run: Run = ctypes.CDLL(str(library)).run
    run.argtypes = [ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p]  # type: ignore[attr-defined]
    run.restype = None  # type: ignore[attr-defined]
    return run


def _make(library: Path, text: str) -> None:
    library.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    # Other jobs may compile the same program now: each writes its own file, and the last one wins.
    with atomic_write(library) as file:
        _compile(compiler(), ["-x", "c++", *_FLAGS.split(), "-", "-o", file.name], text)


@functools.cache
def _target(compiler: str) -> str:
    """Return the compiler's predefined macros: they tell apart the machines that share a cache."""
    return _compile(compiler, [*_FLAGS.split(), "-dM", "-E", "-x", "c++", os.devnull], "")


def _compile(compiler: str, arguments: list[str], text: str) -> str:
    command = [*shlex.split(compiler), *arguments]
    english = os.environ | {"LC_ALL": "C"}
    try:
        done = subprocess.run(
            command,
            input=text,
            text=True,
            capture_output=True,
            check=True,
            env=english,
            start_new_session=True,  # Ctrl-C must not end it: we may want to save first
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise ConfigError(
            f"engine=compiled: the C++ compiler {compiler} doesn't work; engine=eager needs none. "
            f"It says: {_complaint(error)}"
        ) from error
    return done.stdout


def _complaint(error: OSError | subprocess.CalledProcessError) -> str:
    """Return the compiler's error in one line."""
    if isinstance(error, OSError):
        return str(error)
    if error.returncode < 0:
        return f"nothing, it was ended by {signal.Signals(-error.returncode).name}"
    lines = error.stderr.splitlines() or [f"nothing, with exit status {error.returncode}"]
    return next((line for line in lines if "error" in line), lines[-1])
