"""Time the command of `make run`: as a whole, by parts, and beside its imports of TorchRL.

python benchmarks/command.py [repetitions]
"""

import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from machine import describe_machine
from tables import spread, table
from watched import run_watched

FLOOR = "import torch, torchrl.envs, torchrl.objectives"
"""What any program with TorchRL imports."""

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


def cpu_seconds(command: Sequence[str]) -> tuple[float, str]:
    """Return the CPU seconds of a command and its output."""
    before = os.times()
    finished = run_watched(command)
    after = os.times()
    spent = after.children_user + after.children_system
    return spent - before.children_user - before.children_system, finished.output


def measure_stages(runs: int) -> dict[str, float]:
    """Return the CPU seconds of each part of a command, and of the imports of TorchRL alone."""
    floor, _ = cpu_seconds([sys.executable, "-c", FLOOR])
    script = str(Path(__file__).with_name("stages.py"))
    with tempfile.TemporaryDirectory() as directory:
        _, _, *overrides = train_command(runs)
        command = [sys.executable, script, *overrides, f"hydra.run.dir={directory}/job"]
        whole, output = cpu_seconds(command)
    parts: dict[str, float] = json.loads(output.splitlines()[-1])
    return {
        **parts,
        "starting and ending the process": whole - sum(parts.values()),
        "the whole command": whole,
        f"`{FLOOR}` alone": floor,
        "what the command takes more": whole - floor,
    }


def stages_table(runs: int, repetitions: int) -> str:
    """Return a table of the CPU seconds of the command's parts."""
    measure_stages(runs)  # fills the cache of programs
    samples = [measure_stages(runs) for _ in range(repetitions)]
    rows = [[key, spread([sample[key] for sample in samples])] for key in samples[0]]
    return table([f"`python {' '.join(train_command(runs))}`", "CPU seconds"], rows)


def main() -> None:
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    samples = [measure(runs=22).seconds for _ in range(repetitions)]
    print(describe_machine())
    command = " ".join(train_command(runs=22))
    print(f"{command}: seconds, median of {repetitions} (fastest to slowest)")
    for key in samples[0]:
        values = sorted(sample[key] for sample in samples)
        print(f"  {key:18} {median(values):6.1f} ({values[0]:.1f} to {values[-1]:.1f})")
    print(f"\n{stages_table(22, repetitions)}")


if __name__ == "__main__":
    main()
