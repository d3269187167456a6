"""Yardsticks: the default experiment in C and in JAX, and robots with a lidar in other simulators.

`make bench` compares our speed with all of them. `limit_mlp.c` and `limit_tiles.c` are the default
experiment with other value functions. `limit_mountain_car.c` and `jax_mountain_car.py` are
Sarsa(λ) with tile coding in another world. `vmas_lidar.py` and `irsim_lidar.py` drive at random in
VMAS and IR-SIM. JAX, VMAS and IR-SIM have virtual environments of their own.
"""

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from watched import Finished, run_watched

FOLDER = Path(__file__).parent
JAX_PYTHON = FOLDER.parent / ".jax" / "bin" / "python"

_C_STEPS = 15_000_000
"""The learning steps of all runs together, in each of the C program's three measurements."""


@dataclass(frozen=True)
class Limit:
    """A program in C, and how to compile it."""

    source: str
    flags: tuple[str, ...] = ()
    steps: int = _C_STEPS


FNNQ = Limit("limit.c")
NETWORKS = {
    "value=fnnq": FNNQ,
    "value=mlp value.widths=[32]": Limit("limit_mlp.c", steps=5_000_000),
    "value=mlp value.widths=[64,64]": Limit("limit_mlp.c", ("-DLAYERS=2", "-DUNITS=64"), 400_000),
    "value=tiles": Limit("limit_tiles.c", steps=4_000_000),
}
"""The C program for each configuration of ours."""

MOUNTAIN_CAR = {
    "C, lazy": Limit("limit_mountain_car.c"),
    "C, dense": Limit("limit_mountain_car.c", ("-DDENSE",)),
}
"""The C programs for Mountain Car: what a step visits is changed, or all weights and traces."""

_LINE = re.compile(
    r"runs=(?P<runs>\d+) (?P<rate>[\d.]+) M learning steps/s(.*first call (?P<first>[\d.]+) s)?"
)


@dataclass(frozen=True)
class Reading:
    """A measurement of a yardstick, with one number of runs."""

    rate: float  # million learning steps a second
    first_call_seconds: float = 0.0  # of the first call, which compiles
    peak_bytes: int = 0


def build_c_limit(directory: Path, limit: Limit = FNNQ) -> Path | None:
    """Compile a C program into a directory; if that fails, print why and return None."""
    program = directory / "_".join([limit.source.removesuffix(".c"), *limit.flags])
    flags = ["-Ofast", "-march=native", "-fopenmp", *limit.flags]
    try:
        run_watched(["gcc", *flags, str(FOLDER / limit.source), "-o", str(program), "-lm"])
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"C limit: not measured, {reason(error)}", flush=True)
        return None
    return program


def measure_c_limit(program: Path, runs: int, steps: int = _C_STEPS) -> Reading:
    """Measure a C program with a number of runs and of learning steps of all of them."""
    finished = run_watched([str(program), str(runs), str(max(1, steps // runs))])
    return readings_of(finished)[runs]


def measure_jax(python: Path, script: str = "jax_scan.py") -> dict[int, Reading]:
    """Return a JAX script's readings by number of runs; if it fails, print why and return {}.

    The script's numbers of runs are fixed.
    """
    try:
        return readings_of(run_watched([str(python), str(FOLDER / script)]))
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"JAX: not measured, {reason(error)}", flush=True)
        return {}


def version_of(package: str) -> str:
    """Return the pinned version of a yardstick's package, such as ``jax==0.10.2``."""
    lines = [
        line
        for file in sorted(FOLDER.parent.glob("*-requirements.txt"))
        for line in file.read_text().splitlines()
    ]
    return next(line for line in lines if line.startswith(f"{package}=="))


def nearest(readings: dict[int, Reading], runs: int) -> Reading | None:
    """Return the reading with the nearest number of runs, or None if none is within 1 %."""
    found = min(readings, key=lambda size: abs(size - runs), default=0)
    return readings[found] if abs(found - runs) <= 0.01 * runs else None


def readings_of(finished: Finished) -> dict[int, Reading]:
    """Return the readings that a yardstick has printed, by number of runs."""
    return {
        int(line["runs"]): Reading(
            float(line["rate"]), float(line["first"] or 0), finished.peak_bytes
        )
        for line in _LINE.finditer(finished.output)
    }


def reason(error: OSError | subprocess.CalledProcessError) -> str:
    """Return the line that says why a program failed."""
    complaint = error.stderr if isinstance(error, subprocess.CalledProcessError) else ""
    lines = (complaint or str(error)).strip().splitlines()
    return next((line for line in lines if "rror:" in line), lines[-1])
