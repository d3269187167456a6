"""The command that prints the rules a job has learned: ``python -m fnnq_torchrl.rules run=DIR``."""

from fnnq_torchrl.studies.rules.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
