"""Measure memory over many learning steps, or compare a batch's peak with its estimate.

python benchmarks/soak.py [--steps 10]         resident memory up to 10 million learning steps
python benchmarks/soak.py --runs 1000 10000    peak memory of whole commands, beside the estimate
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

from command import measure
from machine import describe_machine
from tables import in_bytes, table
from watched import memory_bytes

from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.memory import sizes_of
from fnnq_torchrl.training.trainer import Trainer

RUNS = 22
MARKS = (1, 2, 5, 10, 20, 50, 100)  # millions of steps
STEPS_A_SITUATION = 45  # a situation takes at least as many steps on average


@dataclass(frozen=True)
class Mark:
    steps: int
    resident_bytes: int


class Watch:
    """A :class:`fnnq_torchrl.engine.scheduler.Keeper` that reads the memory at each of `MARKS`."""

    def __init__(self) -> None:
        self.marks: list[Mark] = []
        self._steps: dict[int, int] = {}

    def visit(self, worker: int, jobs, state) -> None:  # type: ignore[no-untyped-def]
        busy = jobs >= 0
        for job, steps in zip(jobs[busy].tolist(), state["steps"][busy].tolist(), strict=True):
            self._steps[job] = steps[0]
        total = sum(self._steps.values())
        if len(self.marks) < len(MARKS) and total >= MARKS[len(self.marks)] * 1_000_000:
            self.marks.append(Mark(total, memory_bytes("VmRSS")))


def soak(millions: int) -> list[Mark]:
    situations = int(millions * 1_000_000 / RUNS / STEPS_A_SITUATION)
    config = load_config(
        f"num_seeds={RUNS}",
        f"situations={situations}",
        f"evaluation.every={situations}",
        "engine=compiled",
    )
    watch = Watch()
    trainer = Trainer.of(config)
    trainer.learn(keeper=watch)
    return [*watch.marks, Mark(trainer.learning_steps, memory_bytes("VmRSS"))]


def main() -> None:
    parser = argparse.ArgumentParser(description="Memory, by learning steps or by runs.")
    parser.add_argument("--steps", type=int, default=10, help="millions of learning steps")
    parser.add_argument("--runs", type=int, nargs="*", help="numbers of runs of whole commands")
    arguments = parser.parse_args()
    print(describe_machine())
    if arguments.runs:
        rows = []
        for runs in arguments.runs:
            job = Job(load_config(f"num_seeds={runs}"), Path())
            peak, estimate = measure(runs).peak_bytes, sizes_of(Batch([job])).total
            rows.append([f"{runs:,}", in_bytes(peak), in_bytes(estimate)])
        print(table(["runs", "peak of the command", "estimate"], rows))
        return
    marks = soak(arguments.steps)
    rows = [[f"{mark.steps:,}", in_bytes(mark.resident_bytes)] for mark in marks]
    print(table(["learning steps", "resident memory"], rows))


if __name__ == "__main__":
    main()
