"""Time the command of `make run`, as a whole and by parts.

python benchmarks/command.py [repetitions]
"""

import json
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from machine import describe_machine
from watched import run_watched

PARTS = ("train_seconds", "compile_seconds", "evaluate_seconds")


@dataclass(frozen=True)
class CommandRun:
    seconds: dict[str, float]  # by part, as named in summary.json, and of the "whole command"
    peak_bytes: int


def train_command(runs: int) -> list[str]:
    return ["-m", "fnnq_torchrl.train", "lam=0.2", f"num_seeds={runs}"]


def measure(runs: int, environment: Mapping[str, str] | None = None) -> CommandRun:
    """Run the command once, with these environment variables added to those of this process."""
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, *train_command(runs), f"hydra.run.dir={directory}/job"]
        finished = run_watched(command, environment)
        summary = json.loads(Path(directory, "job", "summary.json").read_text())
    parts = {key: summary[key] for key in PARTS}
    return CommandRun({"whole command": finished.seconds, **parts}, finished.peak_bytes)


def main() -> None:
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    samples = [measure(runs=22).seconds for _ in range(repetitions)]
    print(describe_machine())
    command = " ".join(train_command(runs=22))
    print(f"{command}: seconds, median of {repetitions} (fastest to slowest)")
    for key in samples[0]:
        values = sorted(sample[key] for sample in samples)
        print(f"  {key:18} {median(values):6.1f} ({values[0]:.1f} to {values[-1]:.1f})")


if __name__ == "__main__":
    main()
