"""Compare our Stream Q(λ) with the program of its authors; write docs/stream_q.md and its figure.

python -m benchmarks.stream_q [--seeds 5] [--steps 50000]
"""

import argparse
import json
import subprocess
import sys
from datetime import date
from itertools import product
from pathlib import Path

import numpy as np

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.studies.experiments import Experiment, newest_experiment
from fnnq_torchrl.training.pictures.style import save
from fnnq_torchrl.training.results import read_evaluations

from .page import FUZZY, LONGER, OURS, THEIRS, TITLES, Series, figure_of, write_page
from .results import Measured, grouped, in_parts, ours_in_parts, read_measured, write_measured
from .theirs import PROGRAM

KINDS = {"cart_pole": "cart_pole", "acrobot": "acrobot", "follow": "follow_ball"}
"""The world's kind of each task."""

SHARE = 0.05
"""The share of the steps over which ε falls."""


def measure(seeds: int, steps: int) -> list[Measured]:
    """Return the runs of the authors' program, of which those that are missing are made now."""
    runs = read_measured()
    if not PROGRAM.exists():
        print(f"{PROGRAM} is missing, so the authors' program isn't run", file=sys.stderr)
        return runs
    have = {(run.task, run.steps, run.seed) for run in runs}
    for seed, task in product(range(seeds), TITLES):
        if (task, steps, seed) in have:
            continue
        words = ("--task", task, "--seed", str(seed), "--steps", str(steps))
        command = [sys.executable, "-m", "benchmarks.stream_q.theirs", *words]
        ended = subprocess.run(command, check=True, capture_output=True, text=True)
        found = json.loads(ended.stdout.splitlines()[-1])
        groups = grouped(found["ends"], found["returns"], 20 if task == "follow" else 5)
        today = date.today().isoformat()
        returns = tuple(round(float(each), 4) for each in in_parts(*groups, steps))
        runs.append(Measured(task, steps, seed, today, returns))
        write_measured(runs)
    return runs


def read_ours(experiment: Experiment, results: Path, steps: int) -> list[Series]:
    """Return our runs, from the results of the experiment and of the fuzzy network."""
    found = []
    for job in experiment.jobs:
        task = next(task for task, kind in KINDS.items() if kind == job.config.env.kind)
        total = round(job.config.epsilon_over / SHARE)
        who = OURS if total == steps else LONGER
        found.append(Series(task, who, total, ours_in_parts(job.evaluations, total)))
    fuzzy = results / "stream_q_fuzzy" / "evaluations.csv"
    if fuzzy.exists():
        returns = ours_in_parts(read_evaluations(fuzzy, "successes"), steps)
        found.append(Series("follow", FUZZY, steps, returns))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="seeds of the authors' program")
    parser.add_argument("--steps", type=int, default=50_000, help="its learning steps")
    parser.add_argument("--results", type=Path, default=Path("outputs"))
    parser.add_argument("--to", type=Path, default=Path("docs"), help="the folder of the page")
    given = parser.parse_args()
    runs = [run for run in measure(given.seeds, given.steps) if run.steps == given.steps]
    experiment = newest_experiment(given.results, "stream_q")
    series = read_ours(experiment, given.results, given.steps)
    for task in TITLES:
        if returns := [run.returns for run in runs if run.task == task]:
            series.append(Series(task, THEIRS, given.steps, np.array(returns)))
    order = [OURS, THEIRS, LONGER, FUZZY]
    series.sort(key=lambda each: ([*TITLES].index(each.task), order.index(each.who)))
    for ending in ("png", "svg"):
        save(figure_of(series), given.to / "figures" / f"stream_q.{ending}")
    with atomic_write(given.to / "stream_q.md") as file:
        angles = not all(job.settings.get("env.cosines", True) for job in experiment.jobs)
        file.write(write_page(series, [run.date for run in runs], angles=angles).encode())


if __name__ == "__main__":
    main()
