"""Write the page on the paper's claims: ``python -m fnnq_torchrl.reproduction``."""

from fnnq_torchrl.studies.reproduction.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
