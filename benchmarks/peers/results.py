"""All runs of a comparison, by learner, and the file that keeps them."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.intervals import MeanInterval, mean_interval
from fnnq_torchrl.training.results import CONFIDENCE, FINAL_EVALUATIONS

from .learners import PEERS
from .runs import Run

OURS, NO_TRACE = "lam=0.2", "lam=0"
"""Our learners whose scores are shown; the runs of each are one batch."""

ALONE, EAGER = "alone", "eager"
"""Our runs with λ = 0.2 whose time is shown, one at a time: compiled, and a short one eager."""

WORDS = {OURS: "Q(λ), λ = 0.2", NO_TRACE: "Q(λ), λ = 0"} | {
    name: peer.words for name, peer in PEERS.items()
}
"""The names of the compared learners in figures and on the page."""

Results = Mapping[str, list[Run]]


def catches(runs: list[Run]) -> NDArray[np.int64]:
    """Return the catches in all evaluations, ``[runs, evaluations]``."""
    return np.array([run.catches for run in runs])


def mean_score(runs: list[Run]) -> NDArray[np.float64]:
    """Return each run's mean score over all evaluations after learning began, ``[runs]``."""
    return catches(runs)[:, 1:].mean(axis=1)


def final_score(runs: list[Run]) -> NDArray[np.float64]:
    """Return each run's mean score over the last evaluations, ``[runs]``."""
    return catches(runs)[:, 1:][:, -FINAL_EVALUATIONS:].mean(axis=1)


def seconds(runs: list[Run]) -> NDArray[np.float64]:
    """Return the mean wall time until each evaluation, compiling included, ``[evaluations]``."""
    return np.mean([np.add(run.seconds, run.compile_seconds) for run in runs], axis=0)


def eager_seconds(results: Results) -> NDArray[np.float64]:
    """Return the wall time until each evaluation of an eager run, at the speed of the short one."""
    [run] = results[EAGER]
    return np.array(results[OURS][0].steps) * run.seconds[-1] / run.steps[-1]


def at_last(runs: list[Run], goal: float) -> int | None:
    """Return the evaluation from which on the mean over the runs stays at the goal, or None.

    Earlier arrivals don't count: a network may steer well by chance before it has learned anything.
    """
    means = catches(runs).mean(axis=0)
    below = np.flatnonzero(means < goal)
    place = int(below[-1]) + 1 if below.size else 0
    return place if place < means.size else None


def score_interval(scores: NDArray[Any], best: int) -> MeanInterval:
    """Return the mean over the runs with its Student's t interval, cut off where no score can be.

    Args:
        scores: catches or means of catches, ``[runs, ...]``.
        best: the highest possible score.
    """
    mean, low, high = mean_interval(scores, confidence=CONFIDENCE)
    return MeanInterval(mean, np.maximum(low, 0), np.minimum(high, best))


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
