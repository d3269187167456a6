"""Draw the figures of all experiments: ``python -m fnnq_torchrl.figures``."""

from fnnq_torchrl.studies.figures.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
