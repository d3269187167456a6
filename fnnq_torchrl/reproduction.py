"""Writes which of the paper's claims hold: ``python -m fnnq_torchrl.reproduction``."""

from fnnq_torchrl.studies.reproduction.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
