"""The command of the study of prior knowledge: ``python -m fnnq_torchrl.prior``."""

from fnnq_torchrl.studies.prior.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
