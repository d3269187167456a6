"""Compare the DQNs of TorchRL and Stable-Baselines3 with Q(λ): docs/peers.md and its figure.

python -m benchmarks.peers [--seeds 6] [--redraw]
"""

import argparse
import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from itertools import chain, product
from pathlib import Path

from benchmarks.machine import describe_machine
from fnnq_torchrl.training.pictures.style import save

from .figure import peers_figure
from .learners import PEERS, fuzzy_command
from .page import write_page
from .results import ALONE, EAGER, NO_TRACE, OURS, WORDS, read_results, write_results
from .runs import Run, alone, side_by_side
from .task import EVERY, STEPS, task
from .tune import best_rate, read_tuning

TIMES = 3
"""The number of times that a run of ours is timed."""

FEWEST = 5
"""The smallest number of runs of a learner that a conclusion may rest on."""

Measured = Iterator[tuple[str, list[Run]]]
"""Runs, each list with the name of its learner."""


def measure_ours(steps: int, runs: int) -> Measured:
    """Measure the scores of our batches, and the time of our single runs."""
    batch = f"num_seeds={runs}", "engine=compiled"
    single = fuzzy_command(steps, "lam=0.2", "engine=compiled")
    alone(single)  # fills the cache of compiled programs
    for _ in range(TIMES):
        yield ALONE, alone(single)
    yield EAGER, alone(fuzzy_command(min(steps, 2 * EVERY), "lam=0.2", "engine=eager"))
    yield OURS, alone(fuzzy_command(steps, "lam=0.2", *batch))
    yield NO_TRACE, alone(fuzzy_command(steps, "lam=0", *batch))


def measure_peers(steps: int, seeds: int) -> Measured:
    """Measure the peers in turn, so that other work on the machine slows them alike."""
    rates = {peer: best_rate(scores) for peer, scores in read_tuning().items()}
    cases = list(product(range(seeds), PEERS))
    commands = [PEERS[peer].command(seed, steps, rates[peer]) for seed, peer in cases]
    for (_, peer), runs in zip(cases, side_by_side(commands), strict=True):
        yield peer, runs


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=6, help="seeds of each peer")
    parser.add_argument("--runs", type=int, default=1000, help="seeds of each of our learners")
    parser.add_argument("--steps", type=int, default=STEPS, help="learning steps of each run")
    parser.add_argument("--results", type=Path, default=Path("outputs/peers/results.json"))
    parser.add_argument("--to", type=Path, default=Path("docs"), help="the folder of the page")
    parser.add_argument("--redraw", action="store_true", help="only read the results file")
    given = parser.parse_args()
    if min(given.seeds, given.runs) < FEWEST:
        parser.error(f"the page concludes from {FEWEST} runs of each learner or more")
    return given


def main() -> None:
    given = arguments()
    if not given.redraw:
        if absent := [peer.python for peer in PEERS.values() if not Path(peer.python).exists()]:
            sys.exit(f"{absent[0]} isn't there: make peers installs it")
        # Other work on the machine makes wall times longer, so the page gives the load.
        machine = f"{describe_machine()}, at a load of {os.getloadavg()[0]:.1f} before we began"
        measured = defaultdict(list)
        ours = measure_ours(given.steps, given.runs)
        for name, runs in chain(ours, measure_peers(given.steps, given.seeds)):
            measured[name] += runs
            write_results(given.results, machine, measured)  # an interrupt loses little
    machine, results = read_results(given.results)
    if missing := [name for name in (ALONE, EAGER) if name not in results]:
        sys.exit(f"{given.results} has no runs of {missing[0]}: make peers")
    if short := [name for name in WORDS if len(results.get(name, [])) < FEWEST]:
        sys.exit(f"{given.results} has fewer than {FEWEST} runs of {short[0]}: make peers")
    figures = given.to / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    for suffix in ("png", "svg"):
        save(peers_figure(results, len(task().evaluation.situations)), figures / f"peers.{suffix}")
    write_page(given.to / "peers.md", machine, results)
    print(given.to / "peers.md")


if __name__ == "__main__":
    main()
