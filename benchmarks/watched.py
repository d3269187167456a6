"""Run a command and measure its time and memory."""

import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

_LOOK_SECONDS = 0.02


@dataclass(frozen=True)
class Finished:
    output: str
    seconds: float
    peak_bytes: int  # largest resident memory; 0 on systems without /proc


def run_watched(command: Sequence[str], environment: Mapping[str, str] | None = None) -> Finished:
    """Run a command to its end, and return its output, time and peak memory.

    The memory is read while the command runs, since getrusage counts the parent's memory too.

    Args:
        command: the program and its arguments.
        environment: environment variables to set besides those of this process.

    Raises:
        CalledProcessError: if the command failed; the error has the command's stderr as a note.
    """
    start, peak = time.perf_counter(), 0
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | dict(environment or {}),
    ) as process:
        while True:
            peak = max(peak, memory_bytes("VmHWM", process.pid))
            try:
                output, complaint = process.communicate(timeout=_LOOK_SECONDS)
            except subprocess.TimeoutExpired:
                continue
            break
    seconds = time.perf_counter() - start
    if process.returncode:
        error = subprocess.CalledProcessError(process.returncode, command, output, complaint)
        error.add_note(complaint)
        raise error
    return Finished(output, seconds, peak)


def memory_bytes(entry: str, process: int | str = "self") -> int:
    """Return a process's resident memory (``VmRSS``) or its peak (``VmHWM``); 0 without /proc."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    found = (line.split()[1] for line in lines if line.startswith(f"{entry}:"))
    return 1024 * int(next(found, 0))
