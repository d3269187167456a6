"""The command of the study that compares labels: ``python -m fnnq_torchrl.memberships``."""

from fnnq_torchrl.studies.memberships.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
