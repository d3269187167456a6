"""The command that prints the results of jobs: ``python -m fnnq_torchrl.results DIR…``."""

from fnnq_torchrl.studies.results.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
