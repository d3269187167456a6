"""The command that draws a job's rules: ``python -m fnnq_torchrl.plot run=DIR``."""

from fnnq_torchrl.studies.rules.plot_command import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
