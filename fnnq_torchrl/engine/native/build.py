"""Compile a C++ program, cache it and load its function."""

import ctypes
import errno
import functools
import hashlib
import logging
import mmap
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

_ROOM = 2**22
"""The bytes that must be free for a program, its assembly and its object file."""

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


class CannotCompile(ConfigError):
    """An error: programs can't be compiled or loaded on this machine.

    Args:
        reason: the reason, in one line.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason

    def __str__(self) -> str:
        return f"engine=compiled: {self.reason}; engine=eager compiles nothing"


def check_compiler() -> None:
    """Check, in some milliseconds, that programs can be compiled, kept and loaded.

    Raises:
        CannotCompile: if the compiler is missing or can't preprocess an empty file; or neither the
            cache nor the temporary directory has room for a program that can be executed.
    """
    try:
        program, *_ = shlex.split(compiler())
    except ValueError as error:  # an open quotation, or blanks only
        raise CannotCompile(f"CXX={compiler()}: is no command") from error
    if shutil.which(program) is None:
        raise CannotCompile(
            f"there is no C++ compiler {compiler()}; install one, or name it in CXX"
        )
    _target(compiler())
    cache_directory()


def cache_directory() -> Path:
    """Return the directory that caches compiled programs for later jobs.

    If the user's cache can't keep programs, it is a temporary directory of this process.

    Raises:
        CannotCompile: if the temporary directory can't keep programs, either.
    """
    home = os.environ.get("XDG_CACHE_HOME", "")
    return _usable(home if Path(home).is_absolute() else "~/.cache")


@functools.cache
def _usable(home: str) -> Path:
    try:
        directory = Path(home).expanduser() / "fnnq_torchrl"
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        _check_owner(directory)
        _check_room(directory)
    except (OSError, RuntimeError) as error:  # without a home there is no ~
        try:
            directory = Path(_for_this_process().name)
            _check_room(directory)
        except OSError as second:
            raise CannotCompile(f"no directory for programs: {error}; {second}") from second
        _log.info(
            "compiled programs aren't cached: %s; set XDG_CACHE_HOME to another directory", error
        )
    return directory


def _check_owner(directory: Path) -> None:
    """Check that only this user can put programs into a directory, since they are executed.

    Raises:
        PermissionError: if another user owns the directory, or others may write there.
    """
    if sys.platform != "win32":
        found = directory.stat()
        if found.st_uid != os.geteuid() or found.st_mode & 0o022:
            raise PermissionError(errno.EPERM, "other users can write there", str(directory))


def _check_room(directory: Path) -> None:
    """Check that a directory has room for a program and may hold programs.

    Raises:
        OSError: if it is read-only or full, or its programs can't be executed (noexec).
    """
    try:
        with tempfile.TemporaryFile(dir=directory) as file:
            file.write(bytes(_ROOM))
            file.flush()
            if sys.platform != "win32":
                mmap.mmap(file.fileno(), _ROOM, prot=mmap.PROT_READ | mmap.PROT_EXEC).close()
    except PermissionError as error:
        why = f"{error.strerror} (is it mounted noexec?)"
        raise PermissionError(error.errno, why, str(directory)) from error
    except OSError as error:  # it names a temporary file or none
        raise OSError(error.errno, error.strerror, str(directory)) from error


@functools.cache
def _for_this_process() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="fnnq_torchrl_")


def build(text: str) -> Run:
    """Return the function ``run`` of a C++ program, compiling the program if it isn't cached.

    The function releases the GIL.

    Raises:
        CannotCompile: if there is no compiler, it fails, its library can't be loaded, or the
            library can't be written, for example on a full disk.
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
        raise CannotCompile(str(error)) from error


def library_of(text: str) -> Path:
    """Return the place of a program's library in the cache; it may not exist."""
    digest = hashlib.sha256(f"{compiling()}\n{text}".encode()).hexdigest()
    return libraries() / f"{digest[:32]}.so"


def libraries() -> Path:
    """Return the directory of the programs' libraries."""
    return cache_directory() / "native"


def compiling() -> str:
    """Return a text that identifies the compiler, the machine and the flags of a library."""
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
    try:
        library.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        # Other jobs may compile the same program now. Each job writes its own file; the last wins.
        with atomic_write(library) as file:
            arguments = ["-x", "c++", *_FLAGS.split(), "-", "-o", file.name]
            _compile(compiler(), arguments, text, library.parent)
    except OSError as error:
        raise CannotCompile(str(error)) from error


@functools.cache
def _target(compiler: str) -> str:
    """Return the compiler's predefined macros: they tell apart the machines that share a cache."""
    return _compile(compiler, [*_FLAGS.split(), "-dM", "-E", "-x", "c++", os.devnull], "")


def _compile(compiler: str, arguments: list[str], text: str, directory: Path | None = None) -> str:
    """Run the compiler and return its output.

    Args:
        compiler, arguments: its command.
        text: the text that it reads.
        directory: the directory for its files, also the temporary ones; None if it writes none.

    Raises:
        CannotCompile: if it fails.
        OSError: if it fails, and its directory is full.
    """
    command = [*shlex.split(compiler), *arguments]
    surroundings = os.environ | {"LC_ALL": "C"}
    if directory is not None:  # not on another disk, which may be full
        surroundings |= {"TMPDIR": str(directory)}
    try:
        done = subprocess.run(
            command,
            input=text,
            text=True,
            capture_output=True,
            check=True,
            env=surroundings,
            start_new_session=True,  # Ctrl-C must not end it: we may want to save first
        )
    except (OSError, subprocess.CalledProcessError) as error:
        if directory is not None:
            _check_room(directory)  # a linker gives no reason if the disk is full
        raise CannotCompile(
            f"the C++ compiler {compiler} doesn't work. It says: {_complaint(error)}"
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
