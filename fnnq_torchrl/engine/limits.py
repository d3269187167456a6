"""The system's limit on threads. This module needs no torch."""

from threading import Thread

NO_THREADS = (
    "allow more processes (ulimit -u, or pids.max of the control group) or more memory, "
    "or set OMP_NUM_THREADS=1"
)
"""The remedy if no thread can be started, or too few."""


def thread_startable() -> bool:
    """Return whether the limits on processes and memory let this process start a thread."""
    thread = Thread(target=int)
    try:
        thread.start()
    except RuntimeError:  # Python's error for this, and for nothing else
        return False
    thread.join()
    return True
