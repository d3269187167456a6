"""Kill jobs at random moments, also while they write, and restart the same command after each kill.

python benchmarks/torture.py [--kills 25] [--seed 0]

After each kill, every file with a final (not temporary) name must be complete. A finished job must
have the same files, bit for bit, as a job that was never killed, and no other files.
"""

import argparse
import csv
import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import median

import yaml
from machine import describe_machine
from matplotlib.image import imread

from fnnq_torchrl.files.plain import read_plain
from fnnq_torchrl.training.jobs import TRAINING
from fnnq_torchrl.training.results import read_evaluations, read_summary
from fnnq_torchrl.training.resume.saved import FORMAT
from fnnq_torchrl.training.weights import load_checkpoint

EVERY_S = 0.05
ANY_MOMENT = 0.3  # share of the kills that come at any moment, the imports included
MOST_SAVES = 8  # saves, at most, that a start makes before it is killed
LONGEST_S = 600
LOOK_S = 0.001
SITUATIONS = 1000
COMMON = (
    "num_seeds=200",
    f"situations={SITUATIONS}",
    "evaluation.every=50",
    "engine=compiled",
    f"checkpoint.every_s={EVERY_S}",
)
KINDS = {"job": ("lam=0.2", *COMMON), "sweep": ("lam=0,0.4", *COMMON, "-m")}
TIMES = ("train_seconds", "compile_seconds", "evaluate_seconds", "learning_steps_per_second")
SAME = ("checkpoint.pt", "evaluations.csv", "learning_curve.png", "learning_curves.png")


def learned(path: Path) -> int:
    """Return the number of situations that all runs of a saved training have learned from."""
    ledger = read_plain(path, FORMAT, "a saved training")["ledger"]
    done = ledger["learned"][ledger["learned"] == SITUATIONS].sum()
    return int(done + sum(state["situations"].sum() for _, state in ledger["hands"]))


def read_table(path: Path) -> None:
    if path.read_bytes()[-1:] != b"\n":
        raise ValueError(f"{path} is cut short")
    with open(path, newline="") as file:
        lengths = {len(row) for row in csv.reader(file)}
    if len(lengths) != 1:
        raise ValueError(f"{path} has rows of different lengths")


READERS: dict[str, Callable[[Path], object]] = {
    TRAINING: learned,
    "checkpoint.pt": load_checkpoint,
    "evaluations.csv": read_evaluations,
    "summary.json": read_summary,
    "summary.csv": read_table,
    ".png": imread,
    ".yaml": lambda path: yaml.safe_load(path.read_text()),
    ".log": Path.read_text,
}


def check_whole(directory: Path) -> int:
    """Read every file with a final name, and return the number of temporary files."""
    temporary = 0
    for path in sorted(directory.rglob("*")):
        if path.suffix == ".tmp":
            temporary += 1
        elif path.is_file():
            (READERS.get(path.name) or READERS[path.suffix])(path)
    return temporary


def results(directory: Path) -> dict[str, object]:
    """Return by file name the contents that must be the same in all jobs of a kind.

    Raises:
        ValueError: if a file is left over.
    """
    found: dict[str, object] = {}
    for path in sorted(directory.rglob("*")):
        name = str(path.relative_to(directory))
        if path.name in SAME:
            found[name] = path.read_bytes()
        elif path.name == "summary.json":
            summary = json.loads(path.read_text())
            # batch_runs may differ: after a kill, a sweep's last job may resume in a batch alone.
            found[name] = {k: v for k, v in summary.items() if k not in (*TIMES, "batch_runs")}
        elif path.is_file() and path.suffix not in (".yaml", ".log") and path.name != "summary.csv":
            raise ValueError(f"{path} was left over")
    return found


def start(kind: str, directory: Path) -> subprocess.Popen[str]:
    place = "hydra.sweep.dir" if kind == "sweep" else "hydra.run.dir"
    command = [*KINDS[kind], f"{place}={directory}"]
    if kind == "sweep":
        command.append(command.pop(command.index("-m")))  # flags go last
    return subprocess.Popen(
        [sys.executable, "-m", "fnnq_torchrl.train", *command],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def saved_in(directory: Path) -> Sequence[Path]:
    return sorted(directory.rglob(TRAINING))


def saved_at(directory: Path) -> float:
    """Return the time of the last save, in seconds since the epoch, or 0 if nothing is saved."""
    times = []
    for path in saved_in(directory):
        try:
            times.append(path.stat().st_mtime)
        except FileNotFoundError:
            continue
    return max(times, default=0.0)


def saved_since(directory: Path, moment: float) -> bool:
    return saved_at(directory) > moment


def wait_for(moment: Callable[[], bool], process: subprocess.Popen[str], longest_s: float) -> None:
    end = time.monotonic() + longest_s
    while process.poll() is None and not moment() and time.monotonic() < end:
        time.sleep(LOOK_S)


@dataclass(frozen=True)
class Reference:
    """The results of a job that was never killed, and the seconds that the job took."""

    results: dict[str, object]
    seconds: float


def run_reference(kind: str, directory: Path) -> Reference:
    since, process = time.monotonic(), start(kind, directory)
    _, stderr = process.communicate(timeout=LONGEST_S)
    if process.returncode:
        sys.exit(f"{kind}: {stderr}")
    return Reference(results(directory), time.monotonic() - since)


@dataclass
class Tally:
    kills: int = 0
    while_writing: int = 0  # kills that left a temporary file
    resumed: int = 0  # starts that resumed a saved training
    finished: int = 0
    lost_s: list[float] = field(default_factory=list)


def torture(
    kind: str, directory: Path, reference: Reference, rng: random.Random, most: int
) -> Tally:
    """Start a job, kill it and start it again, at most ``most`` times, until it has finished."""
    tally, done = Tally(), 0
    while True:
        process, since = start(kind, directory), time.time()
        if tally.kills < most:
            if rng.random() < ANY_MOMENT:
                wait_for(lambda: False, process, rng.uniform(0, reference.seconds))
            else:  # soon after a save, while the job learns
                for _ in range(rng.randint(1, MOST_SAVES)):
                    wait_for(partial(saved_since, directory, since), process, LONGEST_S)
                    since = saved_at(directory)
                wait_for(lambda: False, process, rng.uniform(0, 2 * EVERY_S))
            if rng.random() < 0.5:
                wait_for(lambda: any(directory.rglob(".*.tmp")), process, 1)
            process.send_signal(signal.SIGKILL)
            killed_at = time.time()
        _, stderr = process.communicate(timeout=LONGEST_S)
        tally.resumed += "going on from" in stderr
        temporary = check_whole(directory)
        if process.returncode == 0:
            tally.finished = 1
            if temporary or results(directory) != reference.results:
                sys.exit(f"{kind} in {directory}: the files differ from an uninterrupted job's")
            return tally
        if process.returncode != -signal.SIGKILL:
            sys.exit(f"{kind}: exit status {process.returncode}: {stderr}")
        tally.kills += 1
        tally.while_writing += temporary > 0
        if saved := saved_in(directory):
            tally.lost_s.append(killed_at - saved_at(directory))
            now = max(map(learned, saved))
            if now < done:
                sys.exit(
                    f"{kind} in {directory}: had learned from {done} situations before the last "
                    f"kill, now from {now}"
                )
            done = now
        print(f"{kind}: killed {tally.kills}, learned from {done:,} situations", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=25)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    print(describe_machine())
    tallies = []
    with tempfile.TemporaryDirectory() as folder:
        references = {kind: run_reference(kind, Path(folder, kind)) for kind in KINDS}
        while (left := arguments.kills - sum(tally.kills for tally in tallies)) > 0:
            kind = list(KINDS)[len(tallies) % len(KINDS)]
            directory = Path(folder, f"{kind}_{len(tallies)}")
            # Only a few kills for each job, so that jobs of both kinds finish.
            share = min(left, rng.randint(2, 7))
            tallies.append(torture(kind, directory, references[kind], rng, share))
    lost = [second for tally in tallies for second in tally.lost_s]
    print(
        f"{sum(tally.kills for tally in tallies)} kills, "
        f"{sum(tally.while_writing for tally in tallies)} of them while writing; "
        f"{sum(tally.resumed for tally in tallies)} starts resumed a saved training; "
        f"{sum(tally.finished for tally in tallies)} jobs and sweeps finished with the same files, "
        "bit for bit; no incomplete file, no file left over."
    )
    if lost:  # a job may be killed before its first save
        print(f"Age of the last save: median {median(lost):.2f} s, at most {max(lost):.2f} s")


if __name__ == "__main__":
    main()
