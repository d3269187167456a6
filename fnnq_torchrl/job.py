"""One job, from its configuration to the files of its output directory."""

from dataclasses import asdict
from pathlib import Path

import torch

from fnnq_torchrl.checkpoint import save_checkpoint
from fnnq_torchrl.config import Config, OutOfRange
from fnnq_torchrl.figures import learning_curve
from fnnq_torchrl.report import Progress, announce, print_summary
from fnnq_torchrl.results import summarise, write_evaluations, write_summary
from fnnq_torchrl.trainer import Trainer


def run_job(config: Config, directory: Path) -> None:
    """Train all runs of a job and say what came of it.

    Leaves ``checkpoint.pt``, ``evaluations.csv``, ``learning_curve.png`` and, last of all,
    ``summary.json`` in the directory, and a table on the screen.

    Raises:
        OutOfRange: the device isn't there.
        ConfigError: the engine is to compile, and the compiler isn't there or fails.
        OSError: a file can't be written.
    """
    _check_device(config.machine.device)
    trainer = Trainer(config)
    announce(trainer.engine_chosen)
    with Progress(trainer.situations_to_learn, "learning") as progress:
        trainer.learn(progress.update)
    with Progress(trainer.situations_to_play, "evaluating") as progress:
        outcome = trainer.evaluate(progress.update)

    evaluations, picture = directory / "evaluations.csv", directory / "learning_curve.png"
    save_checkpoint(
        directory / "checkpoint.pt", trainer.weights, outcome.seed, outcome.lam, asdict(config)
    )
    write_evaluations(evaluations, outcome)
    learning_curve(evaluations, picture, best=len(config.evaluation.situations))
    summary = summarise(outcome)
    write_summary(directory / "summary.json", summary)
    print_summary(summary, picture)


def _check_device(device: str) -> None:
    _, _, index = device.partition("cuda:")
    if device != "cpu" and torch.cuda.device_count() <= int(index or 0):
        found = torch.cuda.device_count()
        raise OutOfRange("machine.device", device, f"there: this machine has {found} CUDA devices")
