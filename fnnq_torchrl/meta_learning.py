"""Write the page on meta-learning: ``python -m fnnq_torchrl.meta_learning``."""

from fnnq_torchrl.studies.meta_learning.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
