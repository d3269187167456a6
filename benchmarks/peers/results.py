"""All runs of a comparison, by learner, and the file that keeps them."""

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
"""Each a batch."""

ALONE, EAGER = "alone", "eager"
"""λ = 0.2, one run at a time; the latter shorter."""

WORDS = {OURS: "Q(λ), λ = 0.2", NO_TRACE: "Q(λ), λ = 0"} | {
    name: peer.words for name, peer in PEERS.items()
}
"""What figures and the page call the learners that they compare."""

Results = Mapping[str, list[Run]]


def catches(runs: list[Run]) -> NDArray[np.int64]:
    """Of all evaluations, ``[runs, evaluations]``."""
    return np.array([run.catches for run in runs])


def mean_score(runs: list[Run]) -> NDArray[np.float64]:
    """Of each run, over all evaluations after learning began."""
    return catches(runs)[:, 1:].mean(axis=1)


def final_score(runs: list[Run]) -> NDArray[np.float64]:
    """Of each run, over the last evaluations."""
    return catches(runs)[:, 1:][:, -FINAL_EVALUATIONS:].mean(axis=1)


def seconds(runs: list[Run]) -> NDArray[np.float64]:
    """Of wall time until each evaluation, compiling included: the mean over the runs."""
    return np.mean([np.add(run.seconds, run.compile_seconds) for run in runs], axis=0)


def eager_seconds(results: Results) -> NDArray[np.float64]:
    """Of a whole run of ours that steps as fast as the shorter one that was measured."""
    [run] = results[EAGER]
    return np.array(results[OURS][0].steps) * run.seconds[-1] / run.steps[-1]


def at_last(runs: list[Run], goal: float) -> int | None:
    """From which evaluation on the runs catch so many on average, to the end, if from any.

    A network may steer well by chance before it has learned anything.
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
    """The machine in words, and the runs."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    return kept["machine"], {
        name: [Run(**run) for run in runs] for name, runs in kept["runs"].items()
    }
