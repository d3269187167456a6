"""Play with a learned controller in the browser: ``python -m fnnq_torchrl.play run=DIR``."""

from fnnq_torchrl.studies.play.command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
