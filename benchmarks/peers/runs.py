"""The result of a learner's run, and the processes that run learners."""

import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Self

from benchmarks.watched import run_watched

Command = Sequence[str]


@dataclass(frozen=True)
class Run:
    """One run. The lists have an entry for each evaluation; the first is before learning."""

    seed: int
    steps: list[int]  # learning steps so far
    seconds: list[float]  # of wall time so far, without imports, compiling and evaluation
    catches: list[int]
    versions: dict[str, str]  # of the libraries it ran with
    compile_seconds: float = 0.0
    world_seconds: float | None = None  # the time of the world's own steps, if it was measured

    @property
    def mean_score(self) -> float:
        """The mean over all evaluations after learning began."""
        return sum(self.catches[1:]) / len(self.catches[1:])

    def to_line(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_line(cls, line: str) -> Self:
        return cls(**json.loads(line))


def versions_of(*libraries: str) -> dict[str, str]:
    return {library: version(library) for library in libraries}


def alone(command: Command) -> list[Run]:
    """Return the runs that a command prints, while we run nothing else.

    Raises:
        CalledProcessError: the command failed; the error has its output as a note.
    """
    return _runs(command, {})


def side_by_side(commands: Iterable[Command]) -> Iterator[list[Run]]:
    """Yield the runs that each command prints; as many run at once as there are cores.

    Raises:
        CalledProcessError: a command failed; the error has its output as a note.
    """
    single = {"OMP_NUM_THREADS": "1"}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        yield from pool.map(lambda command: _runs(command, single), commands)


def _runs(command: Command, environment: dict[str, str]) -> list[Run]:
    finished = run_watched(command, environment)
    print(f"{finished.seconds:5.0f} s  {' '.join(command[1:])}", file=sys.stderr, flush=True)
    # TorchRL logs to stdout.
    lines = [line for line in finished.output.splitlines() if line.startswith("{")]
    return [Run.from_line(line) for line in lines]
