"""Measure speed and memory of a compiled job's learning, without its evaluation and files.

python benchmarks/ours.py num_seeds=22 situations=20     learns once for each line on stdin
"""

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from typing import Self

from watched import memory_bytes


@dataclass(frozen=True)
class Learned:
    steps: int  # learning steps of all runs together, up to the end of each run's last situation
    seconds: float  # without compiling
    compile_seconds: float  # 0 from the second repetition on
    resident_bytes: int  # memory before learning; in the first repetition, that of the imports
    peak_bytes: int

    @property
    def rate(self) -> float:
        """Learning steps a second, in millions."""
        return self.steps / self.seconds / 1e6


class Learner:
    """A process that repeats the same learning, compiled once.

    There is one process for each number of runs, so that the measurements share neither memory nor
    threads. Other programs can be measured between two repetitions. Programs are kept in
    the user's cache, or in the given one.
    """

    def __init__(self, runs: int, situations: int, *overrides: str, cache: str = "") -> None:
        self._overrides = [f"num_seeds={runs}", f"situations={situations}", *overrides]
        self._environment = os.environ | ({"XDG_CACHE_HOME": cache} if cache else {})

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, __file__, *self._overrides],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=self._environment,
        )
        self._read()  # waits for the imports, which would slow down other measurements
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.communicate()

    def learn(self) -> Learned:
        assert self._process.stdin is not None
        print("learn", file=self._process.stdin, flush=True)
        return Learned(**json.loads(self._read()))

    def _read(self) -> str:
        assert self._process.stdout is not None
        if not (line := self._process.stdout.readline()):
            raise RuntimeError(f"{self._overrides}: stopped; the reason is printed above")
        return line


def main() -> None:
    from tensordict import TensorDictBase

    from fnnq_torchrl.engine.loops import Loop, MakeStep
    from fnnq_torchrl.launch.composition import load_config
    from fnnq_torchrl.training.trainer import Trainer

    config = load_config("lam=0.2", "engine=compiled", *sys.argv[1:])
    engine = Trainer.of(config).engine

    made: list[Loop] = []

    def make_loop(
        make_step: MakeStep,
        stays: TensorDictBase,
        state: TensorDictBase,
        recipe: str | None = None,
    ) -> Loop:
        if not made:  # a traced step holds no tensors, so all trainers can share it
            made.append(engine.make_loop(make_step, stays, state, recipe))
        return made[0]

    print("ready", flush=True)
    for _ in sys.stdin:
        trainer = Trainer.of(config)
        trainer.engine = replace(engine, make_loop=make_loop)
        resident = memory_bytes("VmRSS")
        trainer.learn()
        learned = Learned(
            steps=trainer.learning_steps,
            seconds=trainer.ledger.seconds["train"],
            compile_seconds=trainer.ledger.seconds["compile"],
            resident_bytes=resident,
            peak_bytes=memory_bytes("VmHWM"),
        )
        print(json.dumps(asdict(learned)), flush=True)


if __name__ == "__main__":
    main()
