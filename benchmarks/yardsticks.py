"""The same experiment as others would write it: by hand in C, and in JAX.

Neither belongs to this repository. Where one can't be had its column says "not measured".
"""

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from watched import Finished, run_watched

ROOT = Path(__file__).parents[1]
FOLDER = ROOT.parent / "shared" / "yardsticks"
JAX_PYTHON = ROOT / "benchmarks" / ".jax" / "bin" / "python"

_C_STEPS = 15_000_000
"""Of all runs together, in each of the three times that the program takes."""


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
"""By what is set for ours."""

_LINE = re.compile(
    r"runs=(?P<runs>\d+) (?P<rate>[\d.]+) M learning steps/s(.*first call (?P<first>[\d.]+) s)?"
)


@dataclass(frozen=True)
class Reading:
    """What a yardstick says about a number of runs."""

    rate: float  # million learning steps a second
    first_call_seconds: float = 0.0  # compiling, and one call
    peak_bytes: int = 0


def build_c_limit(folder: Path, directory: Path, limit: Limit = FNNQ) -> Path | None:
    """Compile a C program into a directory; None if there is no source or no compiler for it."""
    name = "_".join([limit.source.removesuffix(".c"), *limit.flags])
    source, program = folder / limit.source, directory / name
    flags = ["-Ofast", "-march=native", "-fopenmp", *limit.flags]
    try:
        run_watched(["gcc", *flags, str(source), "-o", str(program), "-lm"])
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"C limit: not measured, {_reason(error)}", flush=True)
        return None
    return program


def measure_c_limit(program: Path, runs: int, steps: int = _C_STEPS) -> Reading:
    finished = run_watched([str(program), str(runs), str(max(1, steps // runs))])
    return _readings(finished)[runs]


def measure_jax(folder: Path, python: Path) -> dict[int, Reading]:
    """By the numbers of runs that the script has built in; none if it doesn't run."""
    try:
        return _readings(run_watched([str(python), str(folder / "jax_scan.py")]))
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"JAX: not measured, {_reason(error)}", flush=True)
        return {}


def jax_version() -> str:
    """As its requirements pin it: ``jax==0.10.2``."""
    lines = Path(__file__).with_name("jax-requirements.txt").read_text().splitlines()
    return next(line for line in lines if line.startswith("jax=="))


def nearest(readings: dict[int, Reading], runs: int) -> Reading | None:
    """The reading for about so many runs: 1,100 will do for 1,104."""
    found = min(readings, key=lambda size: abs(size - runs), default=0)
    return readings[found] if abs(found - runs) <= 0.01 * runs else None


def _readings(finished: Finished) -> dict[int, Reading]:
    return {
        int(line["runs"]): Reading(
            float(line["rate"]), float(line["first"] or 0), finished.peak_bytes
        )
        for line in _LINE.finditer(finished.output)
    }


def _reason(error: OSError | subprocess.CalledProcessError) -> str:
    complaint = error.stderr if isinstance(error, subprocess.CalledProcessError) else ""
    lines = (complaint or str(error)).strip().splitlines()
    return next((line for line in lines if "rror:" in line), lines[-1])
