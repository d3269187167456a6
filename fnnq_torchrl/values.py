"""The command that compares value functions: ``python -m fnnq_torchrl.values``."""

from fnnq_torchrl.studies.values.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
