"""Time the parts of one eager learning step.

python benchmarks/eager_profile.py [runs …]
"""

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from statistics import median
from typing import Any
from unittest.mock import patch

import torch
from tables import short, table
from torch.utils._python_dispatch import TorchDispatchMode

from envs.core import streams
from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy
from fnnq_torchrl.agent.update import Update
from fnnq_torchrl.agent.weight_step import WeightStep
from fnnq_torchrl.engine.lanes import lanes_for, repeat_last
from fnnq_torchrl.engine.threads import threads_for
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.trainer import Trainer

# The functions that belong to each part, with the object in which a step looks them up.
PARTS: dict[str, list[tuple[Any, Callable[..., Any]]]] = {
    "policy": [(ExploringPolicy, ExploringPolicy.forward)],
    "world": [(FollowBall, FollowBall.next_state)],
    "errors": [(PengQLambdaLoss, PengQLambdaLoss.errors)],
    "gradient": [(torch.autograd, torch.autograd.grad)],
    "credit": [(Update, Update.step), (WeightStep, WeightStep.update)],
    "restart": [(FollowBall, FollowBall.restart)],
    "draws": [
        (streams, function)
        for function in (
            streams.draw,
            streams.uniform,
            streams.spare_uniform,
            streams.coin,
            streams.box_muller,
        )
    ],
}
REST = "the rest"
CHUNKS, STEPS = 20, 25

Advance = Callable[[], None]


@dataclass(frozen=True)
class Profile:
    lanes: int
    whole_us: float  # time of a step without the stopwatch
    parts_us: dict[str, float]
    operations: Counter[str]


class Stopwatch:
    """A stopwatch of the seconds of each part, without the parts that this part calls."""

    def __init__(self) -> None:
        self.turns = [REST]
        self.restart()

    def restart(self) -> None:
        self.seconds: Counter[str] = Counter()
        self._since = time.perf_counter()

    def split(self) -> None:
        now = time.perf_counter()
        self.seconds[self.turns[-1]] += now - self._since
        self._since = now

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*args: Any, **kwargs: Any) -> Any:
            self.split()
            self.turns.append(part)
            try:
                return function(*args, **kwargs)
            finally:
                self.split()
                self.turns.pop()

        return wrapped

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Time each part within the ``with`` block."""
        patches = [
            patch.object(owner, function.__name__, self.timed(part, function))
            for part, places in PARTS.items()
            for owner, function in places
        ]
        for each in patches:
            each.start()
        self.restart()
        try:
            yield
        finally:
            self.split()
            for each in reversed(patches):
                each.stop()


class OperationCount(TorchDispatchMode):
    """A count of the aten operations of each part, including those of the gradient."""

    def __init__(self, stopwatch: Stopwatch) -> None:
        super().__init__()
        self._stopwatch = stopwatch
        self.operations: Counter[str] = Counter()

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        self.operations[self._stopwatch.turns[-1]] += 1
        return func(*args, **(kwargs or {}))


def make_step(runs: int) -> tuple[Advance, int, int]:
    """Return a function that advances runs by one step, and its numbers of lanes and elements.

    A lane is a place for a run in the batch. The elements are the action values of one step.
    """
    config = load_config("lam=0.2", "engine=eager", f"num_seeds={runs}")
    trainer = Trainer.of(config)
    lanes = lanes_for(runs, trainer.engine.workers, trainer.engine.most_lanes)
    learner = trainer.make_learner(lanes)
    run = repeat_last(trainer.run, lanes)
    state = learner.begin(run)

    def advance() -> None:
        nonlocal state
        state = learner.step(run, state)

    return advance, lanes, lanes * config.action.candidates


@torch.no_grad()
def profile(runs: int) -> Profile:
    """Time steps with and without the stopwatch by turns, since the machine's load varies."""
    advance, lanes, elements = make_step(runs)
    stopwatch = Stopwatch()
    whole, parts = [], []
    with threads_for(elements):
        for _ in range(2 * STEPS):
            advance()  # warms up
        for _ in range(CHUNKS):
            start = time.perf_counter()
            for _ in range(STEPS):
                advance()
            whole.append(time.perf_counter() - start)
            with stopwatch.watching():
                for _ in range(STEPS):
                    advance()
            parts.append(stopwatch.seconds)
        with stopwatch.watching(), OperationCount(stopwatch) as count:
            advance()
    us = 1e6 / STEPS
    return Profile(
        lanes,
        us * median(whole),
        {part: us * median(chunk[part] for chunk in parts) for part in (*PARTS, REST)},
        count.operations,
    )


def profile_table(sizes: list[int]) -> str:
    profiles = [profile(runs) for runs in sizes]
    operations = profiles[0].operations
    rows = [
        [part, str(operations[part]), *(short(each.parts_us[part]) for each in profiles)]
        for part in (*PARTS, REST)
    ]
    whole = ["a step", str(operations.total()), *(short(each.whole_us) for each in profiles)]
    heads = [
        f"µs, {runs:,} runs on {each.lanes:,} lanes"
        for runs, each in zip(sizes, profiles, strict=True)
    ]
    return table(["part", "aten operations", *heads], [*rows, whole])


def main() -> None:
    sizes = [int(size) for size in sys.argv[1:]] or [22, 110]
    print(profile_table(sizes))


if __name__ == "__main__":
    main()
