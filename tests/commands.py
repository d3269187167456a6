"""The train command, run in the tests' own process."""

import logging
import sys

from fnnq_torchrl import train
from fnnq_torchrl.loggers import Loggers


def fnnq_train(*arguments: object) -> int:
    """The exit status of the command. Hydra sets up the root logger, which is as it was then."""
    Loggers.forget()  # as a new process has none
    root = logging.getLogger()
    level, handlers = root.level, root.handlers[:]
    argv, sys.argv = sys.argv, ["train", *map(str, arguments)]
    try:
        train.main()
    except SystemExit as end:
        return int(end.code or 0)
    finally:
        sys.argv = argv
        for handler in root.handlers:
            if handler not in handlers:
                handler.close()
        root.handlers[:] = handlers
        root.setLevel(level)
    return 0
