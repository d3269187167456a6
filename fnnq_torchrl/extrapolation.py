"""Write the page on Q in unseen states: ``python -m fnnq_torchrl.extrapolation``."""

from fnnq_torchrl.studies.extrapolation.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
