"""The command that writes the report of jobs: ``python -m fnnq_torchrl.report run=DIR``."""

from fnnq_torchrl.studies.report.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
