"""The train command, run in the tests' own process."""

import logging
import signal
import sys

from fnnq_torchrl import train

SIGNALS = [
    getattr(signal, name)
    for name in ("SIGUSR1", "SIGUSR2", "SIGTERM", "SIGINT", "SIGHUP")
    if hasattr(signal, name)
]


def fnnq_train(*arguments: object) -> int:
    """Run the command, return its exit status, and restore logging, signals and ``sys.argv``."""
    root = logging.getLogger()
    level, handlers = root.level, root.handlers[:]
    argv, sys.argv = sys.argv, ["train", *map(str, arguments)]
    told, answers = logging.raiseExceptions, {name: signal.getsignal(name) for name in SIGNALS}
    try:
        train.main()
    except SystemExit as end:
        return int(end.code or 0)
    finally:
        sys.argv = argv
        logging.raiseExceptions = told
        for name, answer in answers.items():
            signal.signal(name, answer)
        for handler in root.handlers:
            if handler not in handlers:
                handler.close()
        root.handlers[:] = handlers
        root.setLevel(level)
    return 0
