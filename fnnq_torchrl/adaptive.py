"""Write the page on adaptive step sizes: ``python -m fnnq_torchrl.adaptive``."""

from fnnq_torchrl.studies.adaptive.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
