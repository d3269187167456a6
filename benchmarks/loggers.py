"""Time the logging of 1,000 runs beside training them: python benchmarks/loggers.py [repetitions]

Each logger has a process of its own. The loggers take turns with training, since the machine's load
varies. wandb with a wandb run for each run logs 100 runs only.
"""

import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from multiprocessing import get_context
from pathlib import Path

from machine import describe_machine
from tables import spread, table

OFFLINE = ("logger=wandb", "logger.wandb.mode=offline")
LOGGERS = {
    "wandb": (1000, OFFLINE),
    "tensorboard": (1000, ("logger=tensorboard",)),
    "mlflow": (1000, ("logger=mlflow",)),
    "wandb, per=run, 100 runs": (100, (*OFFLINE, "logger.wandb.per=run")),
}


def train(runs: int, directory: Path) -> float:
    """Train runs and return the seconds of learning and testing, including compiling."""
    command = ["-m", "fnnq_torchrl.train", f"num_seeds={runs}", f"hydra.run.dir={directory}"]
    subprocess.run([sys.executable, *command], check=True, capture_output=True)
    summary = json.loads((directory / "summary.json").read_text())
    return sum(summary[f"{part}_seconds"] for part in ("train", "compile", "evaluate"))


def log(directory: Path, overrides: list[str]) -> list[float]:
    """Log a job twice and return the seconds of each; the first includes the logger's start."""
    import fnnq_torchrl.training.job  # noqa: F401  # a process that trains has imported this already
    from fnnq_torchrl.launch.composition import load_config
    from fnnq_torchrl.training.jobs import Job
    from fnnq_torchrl.training.loggers import Loggers

    job, seconds = Job(load_config(*overrides), directory), []
    with closing(Loggers()) as loggers:
        for _ in range(2):
            began = time.perf_counter()
            loggers.log_job(job)
            seconds.append(time.perf_counter() - began)
    assert not loggers.left_out
    return seconds


def main() -> None:
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    training: dict[int, list[float]] = {1000: [], 100: []}
    logging: dict[str, list[list[float]]] = {name: [] for name in LOGGERS}
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder:
            for runs, seconds in training.items():
                seconds.append(train(runs, Path(folder, str(runs))))
            for name, (runs, overrides) in LOGGERS.items():
                with ProcessPoolExecutor(1, get_context("spawn")) as process:
                    chosen = [f"num_seeds={runs}", *overrides]
                    logging[name].append(
                        process.submit(log, Path(folder, str(runs)), chosen).result()
                    )
    print(describe_machine())
    for runs, seconds in training.items():
        print(f"{runs:,} runs take {spread(seconds)} s to train and test")
    rows = [[name, *map(spread, zip(*pairs, strict=True))] for name, pairs in logging.items()]
    print(table(["logger", "first job, seconds", "the next, seconds"], rows))


if __name__ == "__main__":
    main()
