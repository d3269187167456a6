"""Which learning rate is each peer's best? Writes tuning.csv, from which `make peers` takes it.

python -m benchmarks.peers.tune [--seeds 2]
"""

import argparse
import csv
from collections.abc import Mapping
from itertools import product
from statistics import mean

from .learners import FOLDER, PEERS
from .runs import side_by_side
from .task import STEPS

LEARNING_RATES = [3e-4, 1e-3, 3e-3]
FIRST_SEED = 1000
"""These runs choose the rate; others, with other seeds, are shown."""

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
    return max(scores, key=lambda rate: mean(scores[rate]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    seeds = range(FIRST_SEED, FIRST_SEED + parser.parse_args().seeds)
    cases = list(product(seeds, LEARNING_RATES, PEERS))
    commands = [PEERS[peer].command(seed, STEPS, rate) for seed, rate, peer in cases]
    with TUNING.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for (seed, rate, peer), [run] in zip(cases, side_by_side(commands), strict=True):
            table.writerow([peer, rate, seed, f"{run.mean_score:.3f}"])
            file.flush()


if __name__ == "__main__":
    main()
