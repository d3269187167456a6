"""Trains a batch of runs: ``python -m fnnq_torchrl.train lam=0.2 seed=3``, or ``fnnq-train …``."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.launch.command import command
from fnnq_torchrl.training.jobs import Job, Result


def train(config: Config, directory: Path) -> float:
    """Trains what the configuration says and writes the results into `directory`."""
    from fnnq_torchrl.training.job import run_job  # after the checks: torch takes seconds to import

    return run_job(config, directory)


def train_batches(
    batches: Sequence[Sequence[Job]], *, pictures: bool
) -> Iterator[Sequence[Result]]:
    """Trains what a multirun has gathered."""
    from fnnq_torchrl.training.job import run_batches

    return run_batches(batches, pictures=pictures)


main = command(train, train_batches)

if __name__ == "__main__":
    main()
