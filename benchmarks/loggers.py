"""How long does it take to log 1,000 runs, beside training them?

python benchmarks/loggers.py [repetitions]

Each logger has a process of its own, and they take turns with training, since what else the machine
does varies. With one wandb run for each run, 100 runs are logged.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from machine import describe_machine
from tables import ratio, spread, table

RUNS, FEWER_RUNS = 1000, 100
LOGGERS = {
    "wandb": ["logger=wandb", "logger.wandb.mode=offline"],
    "tensorboard": ["logger=tensorboard"],
    "mlflow": ["logger=mlflow"],
}
ONE_BY_ONE = [*LOGGERS["wandb"], "logger.wandb.per=run"]


def train(runs: int, directory: Path) -> tuple[float, float]:
    """The seconds of learning and testing, compiling included, and of writing evaluations.csv."""
    command = ["-m", "fnnq_torchrl.train", f"num_seeds={runs}", f"hydra.run.dir={directory}"]
    subprocess.run([sys.executable, *command], check=True, capture_output=True)
    from fnnq_torchrl.training.results import read_evaluations, write_evaluations

    summary = json.loads((directory / "summary.json").read_text())
    evaluations = read_evaluations(directory / "evaluations.csv")
    began = time.perf_counter()
    write_evaluations(directory / "evaluations.csv", evaluations)
    written = time.perf_counter() - began
    return sum(summary[f"{part}_seconds"] for part in ("train", "compile", "evaluate")), written


def measure(directory: Path, overrides: list[str]) -> tuple[float, float]:
    """The seconds that the first job of a process takes to log, and the next, in a new process."""
    command = [sys.executable, __file__, "log", str(directory), *overrides]
    ended = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    first, then = json.loads(ended.stdout)
    return first, then


def log(directory: Path, overrides: list[str]) -> None:
    import fnnq_torchrl.training.job  # noqa: F401  # whoever has trained has imported all this
    from fnnq_torchrl.launch.composition import load_config
    from fnnq_torchrl.training.jobs import Job
    from fnnq_torchrl.training.loggers import Loggers
    from fnnq_torchrl.training.results import read_summary

    runs = read_summary(directory / "summary.json")["runs"]
    job = Job(load_config(*overrides, f"num_seeds={runs}"), directory)
    seconds = []
    for _ in range(2):
        began = time.perf_counter()
        loggers = Loggers(job.config.logger)
        loggers.log_jobs([job])
        seconds.append(time.perf_counter() - began)
        assert not loggers.left_out
    print(json.dumps(seconds))


def main() -> None:
    if sys.argv[1:2] == ["log"]:
        log(Path(sys.argv[2]), sys.argv[3:])
        return
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    training: dict[int, list[float]] = {RUNS: [], FEWER_RUNS: []}
    of_each: dict[str, list[tuple[float, float]]] = {name: [] for name in ("csv", *LOGGERS, "runs")}
    for _ in range(repetitions):
        with tempfile.TemporaryDirectory() as folder:
            trained, written = train(RUNS, Path(folder, "job"))
            training[RUNS].append(trained)
            of_each["csv"].append((written, written))
            for name, overrides in LOGGERS.items():
                of_each[name].append(measure(Path(folder, "job"), overrides))
            training[FEWER_RUNS].append(train(FEWER_RUNS, Path(folder, "fewer"))[0])
            of_each["runs"].append(measure(Path(folder, "fewer"), ONE_BY_ONE))
    print(describe_machine())
    for runs, seconds in training.items():
        print(f"{runs:,} runs take {spread(seconds)} s to train and test")
    rows = []
    for name, pairs in of_each.items():
        runs = FEWER_RUNS if name == "runs" else RUNS
        first, then = ([*seconds] for seconds in zip(*pairs, strict=True))
        words = f"wandb, per=run, {runs} runs" if name == "runs" else name
        of_training = [ratio(each, training[runs]) for each in (first, then)]
        rows.append([words, spread(first), of_training[0], spread(then), of_training[1]])
    columns = ["logger", "first job, seconds", "of its training", "the next, seconds", "of it"]
    print(table(columns, rows))


if __name__ == "__main__":
    main()
