"""How long does the command that `make run` runs take, from its start to its end?

python benchmarks/command.py [repetitions]
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from machine import describe_machine

COMMAND = [sys.executable, "-m", "fnnq_torchrl.train", "lam=0.2", "num_seeds=22"]


def measure() -> dict[str, float]:
    """Seconds of one run of the command: the whole, and its parts as the job itself counts them."""
    with tempfile.TemporaryDirectory() as directory:
        start = time.perf_counter()
        subprocess.run(
            [*COMMAND, f"hydra.run.dir={directory}/job"], check=True, capture_output=True
        )
        whole = time.perf_counter() - start
        summary = json.loads(Path(directory, "job", "summary.json").read_text())
    parts = {key: summary[key] for key in ("train_seconds", "evaluate_seconds")}
    return {"whole command": whole, **parts}


def main() -> None:
    repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    samples = [measure() for _ in range(repetitions)]
    print(describe_machine())
    print(f"{' '.join(COMMAND[1:])}: seconds, median of {repetitions} (fastest to slowest)")
    for key in samples[0]:
        values = sorted(sample[key] for sample in samples)
        print(f"  {key:18} {median(values):6.1f} ({values[0]:.1f} to {values[-1]:.1f})")


if __name__ == "__main__":
    main()
