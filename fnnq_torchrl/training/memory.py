"""Estimates the memory of a batch, and compares it with the free memory before the batch begins.

The estimate is made from sizes alone; `benchmarks/soak.py` compares it with measured memory.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path

import torch

from envs.core.registry import is_own
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.parts import make_rule, make_step_size
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.engine.lanes import lanes_for
from fnnq_torchrl.training.batch import Batch

_MUCH = 1 / 4
"""The part of the free memory above which a line tells the user how much a batch needs."""

_NUMBER = 8
"""Bytes of an int64, a float64 or a reference to a Python object."""

_OF_PYTHON = 6 * _NUMBER
"""Bytes of a small Python object in a list, including the reference to it."""

_BASE = 600 * 2**20
"""Bytes of the process without any run: torch, TorchRL, the traced step."""

_COLUMNS = 40
"""Numbers kept for each run: its values as lists and tensors, in its job and in the batch."""

_TOLD = 4
"""Numbers kept for each evaluation besides weights and steps: α, temperature, γ and a flag."""

_COPIES = 4
"""Numbers that an eager step keeps for each candidate action; a native step keeps fewer."""


@dataclass(frozen=True)
class Sizes:
    """The sizes that a batch's memory depends on.

    Attributes:
        runs: the number of runs.
        evaluations: the number of evaluations of each run, including the one before learning.
        tests: the number of situations in each evaluation.
        weights: the number of weights of each run.
        candidates: the number of candidate actions.
        window: the number of steps that ``trace=window`` keeps; 1 for other traces.
        lanes: the number of runs that learn at once, in all workers together.
        bytes: the bytes of one weight.
        counted: the number of rules of each run whose firing strengths are summed.
        remembered: the numbers that the rule for the step size remembers of each weight.
    """

    runs: int
    evaluations: int
    tests: int
    weights: int
    candidates: int
    window: int
    lanes: int
    bytes: int
    counted: int = 0
    remembered: int = 0

    @property
    def kept(self) -> int:
        """Bytes kept to the end: what all evaluations have, their tests, and the runs' values."""
        of_test = 2 + self.bytes + 4  # two flags (played, success), return, length
        of_evaluation = (self.weights + _TOLD) * self.bytes + _NUMBER + self.tests * of_test + 1
        of_run = _COLUMNS * _NUMBER + self.counted * self.bytes
        return self.runs * (self.evaluations * of_evaluation + of_run)

    @property
    def at_work(self) -> int:
        """Bytes for the runs that learn at once: weights, trace, memory and numbers of a step."""
        of_weight = 4 + self.window + 2 * self.remembered
        of_step = self.weights * of_weight + self.candidates * _COPIES + 3 * self.counted
        return self.lanes * self.bytes * of_step + self.candidates * self.weights * self.bytes

    @property
    def on_top(self) -> int:
        """Bytes of the largest of three short needs: playing situations, writing rows, saving."""
        playing = self.tests * 2 * _NUMBER
        writing = 4 * _OF_PYTHON  # steps, catches, their text, the picture
        saving = self.weights * self.bytes
        return self.runs * self.evaluations * max(playing, writing, saving)

    @property
    def total(self) -> int:
        """Bytes of the process at its peak."""
        return _BASE + self.kept + max(self.at_work, self.on_top)


def sizes_of(batch: Batch) -> Sizes:
    """Return the sizes of a batch, from its configuration, engine and number of runs."""
    config, engine, runs = batch.config, batch.engine, batch.size
    dtype: torch.dtype = getattr(torch, config.machine.dtype)
    # Meta tensors have a shape and take no memory. A user's own network may need real values.
    device = "cpu" if is_own(config.value.kind) else "meta"
    candidates = make_candidates(config, dtype, device)
    network = make_value_network(config.value, candidates, runs=1)
    weights = dict(network.named_parameters())
    return Sizes(
        runs=runs,
        evaluations=config.situations // config.evaluation.every + 1,
        tests=config.evaluation.tests,
        weights=sum(weight.numel() for weight in weights.values()),
        candidates=candidates.numel(),
        window=make_rule(config).trace.start(torch.empty(1, 1, device="meta")).numel(),
        lanes=engine.workers * lanes_for(runs, engine.workers, engine.most_lanes),
        bytes=dtype.itemsize,
        counted=weights["weight"].numel() if config.counts_firing else 0,
        remembered=len(make_step_size(config).start(torch.ones(1), [torch.ones(1, 1)])),
    )


def check_memory(batch: Batch) -> str | None:
    """Refuse a batch that this machine's memory can't hold.

    Returns:
        A line to print if the batch will take much of the free memory; otherwise None.

    Raises:
        ConfigError: if the batch needs more memory than is free.
    """
    config, runs = batch.config, batch.size
    sizes, free = sizes_of(batch), available(config.machine.device)
    needs = (
        f"{runs:,} run{'s' if runs > 1 else ''} with {sizes.evaluations:,} evaluations "
        f"of {sizes.weights:,} weights each "
        f"and {sizes.candidates:,} candidate actions need about {_gigabytes(sizes.total)} of memory"
    )
    if sizes.total > free:
        raise ConfigError(f"{needs}, and {_gigabytes(free)} are free: {_smaller(config, sizes)}")
    return f"{needs}; {_gigabytes(free)} are free" if sizes.total > free * _MUCH else None


def _smaller(config: Config, sizes: Sizes) -> str:
    """Return advice on the keys to change: those that the largest part of the memory depends on."""
    if sizes.at_work > max(sizes.kept, sizes.on_top):
        keys = ["action.candidates", "value"] + ["window"] * (config.trace == "window")
        return f"choose a smaller {' or '.join(keys)}"
    return "choose fewer num_seeds per job, or a larger evaluation.every"


def _gigabytes(count: float) -> str:
    return f"{count / 1e9:,.1f} GB"


def available(device: str = "cpu") -> float:
    """Return the bytes of free memory, or infinity if the system doesn't tell.

    Args:
        device: the device of the runs. For a GPU, the result is the smaller of the GPU's free
            memory and the machine's.
    """
    of_device = inf if device == "cpu" else torch.cuda.mem_get_info(device)[0]
    return min(_free_of_machine(), *_limits_of_groups(), of_device)


def _free_of_machine() -> float:
    try:
        words = Path("/proc/meminfo").read_text().split()
        return 1024 * int(words[words.index("MemAvailable:") + 1])
    except (OSError, ValueError):
        return inf  # not Linux


def _limits_of_groups(
    root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")
) -> Iterator[int]:
    """Yield the memory limits of this process's control groups (Linux), in bytes."""
    if not own.exists():
        return
    for line in own.read_text().splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "":  # version 2
            group, name = root / path.lstrip("/"), "memory.max"
        elif controllers == "memory":  # version 1
            group, name = root / "memory" / path.lstrip("/"), "memory.limit_in_bytes"
        else:
            continue
        for folder in (group, *group.parents):
            with suppress(OSError, ValueError):  # no such file, or its content is "max"
                yield int((folder / name).read_text())
