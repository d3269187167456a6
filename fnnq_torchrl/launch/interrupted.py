"""The way a command ends after the signal SIGINT."""

import sys
from typing import NoReturn

from fnnq_torchrl.engine.limits import NO_THREADS, thread_startable


def leave_interrupted(again: str = "") -> NoReturn:
    """End the program after SIGINT with one line and an exit status.

    Ctrl-C sends SIGINT, and OpenBLAS raises SIGINT if it can't start its threads. If no thread can
    be started, the line names that cause and the status is 1; otherwise the status is 130.

    Args:
        again: the command that resumes the work; empty if there is none.
    """
    status, line = 130, "interrupted"
    if not thread_startable():
        status, line = 1, f"ended by a library that can't start its threads: {NO_THREADS}"
    sys.stderr.write(line + (f"; to go on: {again}" if again else "") + "\n")
    sys.exit(status)
