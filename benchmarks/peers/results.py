"""The runs of a comparison by learner, and the file that keeps them."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.results import FINAL_EVALUATIONS

from .learners import PEERS
from .runs import Run

OURS, NO_TRACE = "lam=0.2", "lam=0"
"""Our two learners, each measured as a batch of runs."""

ALONE, EAGER = "alone", "eager"
"""λ = 0.2, one run at a time: compiled, and eager with fewer steps."""

WORDS = {OURS: "Q(λ), λ = 0.2", NO_TRACE: "Q(λ), λ = 0"} | {
    name: peer.words for name, peer in PEERS.items()
}
"""The learners' names in the figure and on the page."""

Results = Mapping[str, list[Run]]


def catches(runs: list[Run]) -> NDArray[np.int64]:
    """Return the catches in each evaluation, ``[runs, evaluations]``."""
    return np.array([run.catches for run in runs])


def mean_score(runs: list[Run]) -> NDArray[np.float64]:
    """Return each run's mean score over all evaluations but the one before learning."""
    return catches(runs)[:, 1:].mean(axis=1)


def final_score(runs: list[Run]) -> NDArray[np.float64]:
    """Return each run's mean score over the last evaluations."""
    return catches(runs)[:, 1:][:, -FINAL_EVALUATIONS:].mean(axis=1)


def seconds(runs: list[Run]) -> NDArray[np.float64]:
    """Return the mean wall time until each evaluation, compiling included."""
    return np.mean([np.add(run.seconds, run.compile_seconds) for run in runs], axis=0)


def eager_seconds(results: Results) -> NDArray[np.float64]:
    """Return the seconds until each evaluation of an eager run, from those of a shorter one."""
    [run] = results[EAGER]
    return np.array(results[OURS][0].steps) * run.seconds[-1] / run.steps[-1]


def at_last(runs: list[Run], goal: float) -> int | None:
    """Return the evaluation from which on the mean stays at or above the goal, if there is one.

    A network may steer well by chance before it has learned anything, so the first such evaluation
    doesn't count.
    """
    means = catches(runs).mean(axis=0)
    below = np.flatnonzero(means < goal)
    place = int(below[-1]) + 1 if below.size else 0
    return place if place < means.size else None


def write_results(path: Path, machine: str, results: Results) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    runs = {name: [asdict(run) for run in runs] for name, runs in results.items()}
    with atomic_write(path) as file:
        file.write(json.dumps({"machine": machine, "runs": runs}).encode())


def read_results(path: Path) -> tuple[str, Results]:
    """Return the machine in words, and the runs."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    return kept["machine"], {
        name: [Run(**run) for run in runs] for name, runs in kept["runs"].items()
    }
