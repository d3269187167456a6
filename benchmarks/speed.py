"""Measure speed and memory of learning, beside the same experiment in C and in JAX.

python benchmarks/speed.py [--write docs/performance.md] [--large]
                           [--only learning|mountain_car]

All programs take turns, since the machine's load varies. A learning step is one step of the world
and one Q(λ) update of one run.
"""

import argparse
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from command import PARTS, CommandRun, measure, stages_table, train_command
from machine import describe_machine
from ours import Learned, Learner
from page import write_page
from tables import NOT_MEASURED, in_bytes, median_of, ratio, short, spread, table
from yardsticks import (
    JAX_PYTHON,
    MOUNTAIN_CAR,
    NETWORKS,
    Reading,
    build_c_limit,
    measure_c_limit,
    measure_jax,
    nearest,
    version_of,
)

RUNS = [22, 110, 1104, 11008, 49984]
NETWORK_RUNS = 1104
MOUNTAIN_CAR_RUNS = {1_104: 10_000, 11_008: 2_000}
"""The steps of each run of the C programs, by the number of runs."""
LARGE = 100_000
MEMORY_RUNS = 11_008
_SHARE = "whole command / (train + evaluate)"


@dataclass
class Size:
    """The measurements with one number of runs, one entry for each repetition."""

    runs: int
    situations: int
    ours: list[Learned] = field(default_factory=list)
    c: list[Reading] = field(default_factory=list)
    jax: list[Reading] = field(default_factory=list)
    fresh: Learned | None = None  # measured in a new process with the program in the cache


def measure_sizes(sizes: list[Size], repetitions: int, jax: Path) -> None:
    with tempfile.TemporaryDirectory() as directory, ExitStack() as processes:
        c_limit = build_c_limit(Path(directory))
        learners = [processes.enter_context(Learner(size.runs, size.situations)) for size in sizes]
        for repetition in range(repetitions):
            readings = measure_jax(jax)
            for size, learner in zip(sizes, learners, strict=True):
                if c_limit is not None:
                    size.c.append(measure_c_limit(c_limit, size.runs))
                size.ours.append(learner.learn())
                if reading := nearest(readings, size.runs):
                    size.jax.append(reading)
                told = f"{size.runs:,} runs: {short(size.ours[-1].rate)} M learning steps/s"
                print(f"{repetition + 1}/{repetitions}, {told}", file=sys.stderr, flush=True)
    for size in {id(size): size for size in compared(sizes)}.values():
        with Learner(size.runs, size.situations) as learner:
            size.fresh = learner.learn()


def compared(sizes: list[Size]) -> tuple[Size, Size]:
    """Return the sizes that the memory table compares: the first, and the one of MEMORY_RUNS."""
    return sizes[0], next((size for size in sizes if size.runs == MEMORY_RUNS), sizes[-1])


def speed_table(sizes: list[Size]) -> str:
    rows = []
    for size in sizes:
        rates = [[one.rate for one in side] for side in (size.c, size.jax, size.ours)]
        c, jax, ours = rates
        cells = [*map(spread, rates), ratio(ours, jax), ratio(ours, c)]
        rows.append([f"{size.runs:,}", f"{size.situations:,}", *cells])
    return table(["runs", "situations", "C limit", "JAX", "ours", "ours/JAX", "ours/C"], rows)


def network_table(repetitions: int) -> str:
    """Return a table of the value functions beside C, and of compiling with an empty cache."""
    rows = []
    for overrides, limit in NETWORKS.items():
        situations = 20 if limit.steps < 1_000_000 else 200
        given = (NETWORK_RUNS, situations, *overrides.split(), "alpha=0.02")
        ours, c = [], []
        with (
            tempfile.TemporaryDirectory() as directory,
            Learner(*given, cache=directory) as learner,
        ):
            program = build_c_limit(Path(directory), limit)
            cold = learner.learn().compile_seconds
            for _ in range(repetitions):
                ours.append(learner.learn().rate)
                if program is not None:
                    c.append(measure_c_limit(program, NETWORK_RUNS, limit.steps).rate)
        rows.append([f"`{overrides}`", spread(c), spread(ours), ratio(ours, c), short(cold)])
    return table(["", "C limit", "ours", "ours/C", "compiling, cold, s"], rows)


def mountain_car_table(repetitions: int, jax: Path) -> str:
    """Return a table of Sarsa(0.9) with tile coding in Mountain Car, 50 situations of each run."""
    overrides = ("+experiment=sutton_barto_12_10", "lam=0.9", "alpha=0.0625")
    names = [*MOUNTAIN_CAR, "JAX", "ours"]
    rates = {(runs, name): list[float]() for runs in MOUNTAIN_CAR_RUNS for name in names}
    with tempfile.TemporaryDirectory() as directory, ExitStack() as processes:
        built = {name: build_c_limit(Path(directory), of) for name, of in MOUNTAIN_CAR.items()}
        programs = {name: program for name, program in built.items() if program is not None}
        learners = {
            runs: processes.enter_context(Learner(runs, 50, *overrides))
            for runs in MOUNTAIN_CAR_RUNS
        }
        for _ in range(repetitions):
            readings = measure_jax(jax, "jax_mountain_car.py")
            for runs, steps in MOUNTAIN_CAR_RUNS.items():
                for name, program in programs.items():
                    reading = measure_c_limit(program, runs, steps * runs)
                    rates[runs, name].append(reading.rate)
                if found := nearest(readings, runs):
                    rates[runs, "JAX"].append(found.rate)
                rates[runs, "ours"].append(learners[runs].learn().rate)
    rows = []
    for runs in MOUNTAIN_CAR_RUNS:
        *others, ours = (rates[runs, name] for name in names)
        shares = [ratio(ours, other) for other in others]
        rows.append([f"{runs:,}", *map(spread, [*others, ours]), *shares])
    shares = ["ours/lazy", "ours/dense", "ours/JAX"]
    return table(["runs", *MOUNTAIN_CAR, "JAX", "ours", *shares], rows)


def compile_table(sizes: list[Size]) -> str:
    rows = [
        [
            f"{size.runs:,}",
            short(size.fresh.compile_seconds),
            spread([one.first_call_seconds for one in size.jax]),
        ]
        for size in sizes
        if size.fresh
    ]
    return table(["runs", "ours, from the cache", "JAX, first call"], rows)


def memory_table(sizes: list[Size]) -> str:
    """Return a table of the memory of the process, of each run, and of each additional run."""
    few, size = compared(sizes)
    assert few.fresh is not None
    assert size.fresh is not None
    before, ours = size.fresh.resident_bytes, size.fresh.peak_bytes
    c = median_of(one.peak_bytes for one in size.c)
    rows = [
        [f"peak with {size.runs:,} runs", in_bytes(ours), in_bytes(c)],
        ["of which before learning", in_bytes(before), in_bytes(0)],
        ["the rest, for each run", in_bytes((ours - before) / size.runs), in_bytes(c / size.runs)],
    ]
    if more := size.runs - few.runs:
        ours -= few.fresh.peak_bytes
        c -= median_of(one.peak_bytes for one in few.c)
        added = f"what each run more than {few.runs:,} adds"
        rows.append([added, in_bytes(ours / more), in_bytes(c / more)])
    if not size.c:
        rows = [[label, of_ours, NOT_MEASURED] for label, of_ours, _ in rows]
    return table(["", "ours", "C limit"], rows)


def command_table(runs: int, repetitions: int) -> str:
    """Return a table of the command's times, first with an empty cache of compiled programs."""
    if not runs:
        return NOT_MEASURED
    with tempfile.TemporaryDirectory() as cache:
        environment = {"XDG_CACHE_HOME": cache}
        cold, *warm = (measure(runs, environment) for _ in range(1 + repetitions))
    rows = [
        [key, short(cold.seconds[key]), spread([one.seconds[key] for one in warm])]
        for key in cold.seconds
    ]
    rest = [short(_rest(cold)), spread([*map(_rest, warm)])]
    share = [short(_share(cold)), spread([*map(_share, warm)])]
    title = f"`python {' '.join(train_command(runs))}`, seconds"
    return table([title, "cold", "warm"], [*rows, ["the rest", *rest], [_SHARE, *share]])


def _rest(run: CommandRun) -> float:
    return run.seconds["whole command"] - sum(run.seconds[part] for part in PARTS)


def _share(run: CommandRun) -> float:
    seconds = run.seconds
    return seconds["whole command"] / (seconds["train_seconds"] + seconds["evaluate_seconds"])


def large_line() -> str:
    run = measure(LARGE)
    return (
        f"`python {' '.join(train_command(LARGE))}`, 200 situations each, evaluation and files "
        f"included, took {in_bytes(run.peak_bytes)} at its peak "
        f"({short(run.seconds['whole command'])} s)."
    )


def eager_table() -> str:
    script = Path(__file__).with_name("eager_profile.py")
    return subprocess.check_output([sys.executable, script], text=True).strip()


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, nargs="+", default=RUNS)
    parser.add_argument("--situations", type=int, help="of each run; default: 200, or fewer")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--command-runs", type=int, default=10_000, help="0: skip the command")
    parser.add_argument("--large", action="store_true", help=f"add {LARGE:,} runs: minutes more")
    parser.add_argument("--only", choices=["learning", "mountain_car"], help="print this table")
    parser.add_argument("--jax", type=Path, default=JAX_PYTHON, help="a Python that has JAX")
    parser.add_argument("--write", type=Path, help="page to write; its hand-written part is kept")
    return parser.parse_args()


def main() -> None:
    given = arguments()
    if given.only == "mountain_car":
        print(mountain_car_table(given.repetitions, given.jax))
        return
    # Fewer situations for the largest numbers of runs, to keep the benchmark short.
    sizes = [Size(runs, given.situations or (50 if runs > 20_000 else 200)) for runs in given.runs]
    measure_sizes(sizes, given.repetitions, given.jax)
    if given.only == "learning":
        print(speed_table(sizes))
        return
    sections = {
        "machine": describe_machine(),
        "gpu": "It has no GPU, so there are no figures on one: they are still to be measured.",
        "jax": version_of("jax"),
        "repetitions": str(given.repetitions),
        "speed": speed_table(sizes),
        "networks": network_table(given.repetitions),
        "network_runs": f"{NETWORK_RUNS:,}",
        "mountain_car": mountain_car_table(given.repetitions, given.jax),
        "compile": compile_table(sizes),
        "memory": memory_table(sizes),
        "command": command_table(given.command_runs, given.repetitions),
        "stages": stages_table(22, given.repetitions),
        "large": large_line() if given.large else f"{LARGE:,} runs: {NOT_MEASURED}.",
        "eager": eager_table() if given.write else "python benchmarks/eager_profile.py",
    }
    print("\n\n".join(sections.values()))
    if given.write:
        write_page(given.write, sections)


if __name__ == "__main__":
    main()
