"""Trains a batch of runs: ``python -m fnnq_torchrl.train lam=0.2 seed=3``."""

from pathlib import Path

from fnnq_torchrl.cli import command
from fnnq_torchrl.config import Config


@command
def main(config: Config, directory: Path) -> None:
    """Trains what the configuration says and writes the results into `directory`."""
    from fnnq_torchrl.job import run_job  # after the checks: torch takes seconds to import

    run_job(config, directory)


if __name__ == "__main__":
    main()
