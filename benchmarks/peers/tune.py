"""Find each peer's best learning rate, and write tuning.csv, from which `make peers` takes it.

python -m benchmarks.peers.tune [--seeds 3]
"""

import argparse
import csv
from collections.abc import Mapping
from itertools import product
from statistics import mean

from fnnq_torchrl.files.atomic import atomic_write

from .learners import FOLDER, PEERS
from .runs import side_by_side
from .task import STEPS

LEARNING_RATES = [3e-5, 1e-4, 3e-4, 1e-3, 3e-3]
FIRST_SEED = 1000
"""The first seed of the runs that choose the rate; the page shows runs with other seeds."""

TUNING = FOLDER / "tuning.csv"
COLUMNS = ["peer", "learning_rate", "seed", "mean_score"]

Scores = Mapping[str, Mapping[float, list[float]]]
"""The mean scores by peer and learning rate."""


def read_tuning() -> Scores:
    scores: dict[str, dict[float, list[float]]] = {}
    with TUNING.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            by_rate = scores.setdefault(row["peer"], {})
            by_rate.setdefault(float(row["learning_rate"]), []).append(float(row["mean_score"]))
    return scores


def best_rate(scores: Mapping[float, list[float]]) -> float:
    """Return the rate with the highest mean, to three decimals; of several such, the largest."""
    return max(scores, key=lambda rate: (round(mean(scores[rate]), 3), rate))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(FIRST_SEED, FIRST_SEED + parser.parse_args().seeds)
    cases = list(product(seeds, LEARNING_RATES, PEERS))
    commands = [PEERS[peer].command(seed, STEPS, rate) for seed, rate, peer in cases]
    rows = [COLUMNS]
    for (seed, rate, peer), [run] in zip(cases, side_by_side(commands), strict=True):
        rows.append([peer, f"{rate:g}", str(seed), f"{run.mean_score:.3f}"])
    with atomic_write(TUNING) as file:
        file.writelines(f"{','.join(row)}\n".encode() for row in rows)


if __name__ == "__main__":
    main()
