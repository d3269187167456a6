"""The command that compares with the textbook's figures: ``python -m fnnq_torchrl.textbook``."""

from fnnq_torchrl.studies.textbook.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
