"""The command of the study of learning among obstacles: ``python -m fnnq_torchrl.simulator``."""

from fnnq_torchrl.studies.simulator.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
