"""How much memory a batch of runs will take, and how much there is: told before anything computes.

An estimate, from the sizes alone; `benchmarks/soak.py` compares it with what jobs really take.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path

import torch

from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.engine.choice import choose, make_engine
from fnnq_torchrl.engine.lanes import lanes_for

_GROUPS, _OWN_GROUPS = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")

_MUCH = 1 / 4
"""Of the free memory: from then on it is said beforehand."""

_NUMBER = 8
"""Bytes of an int64, a float64 or a reference to a Python object."""

_OF_PYTHON = 6 * _NUMBER
"""Bytes of a small Python object that stands in a list, with its reference."""

_BASE = 600 * 2**20
"""Bytes of the process before it has any run: torch, TorchRL, the traced step."""

_COLUMNS = 40
"""Columns of numbers of each run: its values as lists and as tensors, of the jobs and the batch."""

_COPIES = 4
"""Of what an eager step, the most wasteful, computes for each candidate action."""


@dataclass(frozen=True)
class Sizes:
    """What a batch is made of.

    Attributes:
        runs: in the batch.
        evaluations: of each run, the one before learning included.
        tests: situations in each.
        weights: of a run.
        candidates: actions among which a run seeks the best.
        window: steps that a run's trace keeps, 1 if it isn't a window.
        lanes: runs that learn at once, of all workers together.
        bytes: of a weight.
    """

    runs: int
    evaluations: int
    tests: int
    weights: int
    candidates: int
    window: int
    lanes: int
    bytes: int

    @property
    def kept(self) -> int:
        """Bytes for what is kept of all evaluations: weights, steps, catches, what is played."""
        of_evaluation = self.weights * self.bytes + 2 * _NUMBER + self.tests + 1
        return self.runs * (self.evaluations * of_evaluation + _COLUMNS * _NUMBER)

    @property
    def at_work(self) -> int:
        """Bytes for the runs that learn at once: state, trace, and what a step computes."""
        of_step = self.weights * (4 + self.window) + self.candidates * _COPIES
        return self.lanes * self.bytes * of_step + self.candidates * self.weights * self.bytes

    @property
    def on_top(self) -> int:
        """Bytes at the end: the list of all situations to play or, later, the rows to write."""
        playing = self.tests * 2 * _NUMBER
        writing = 4 * _OF_PYTHON  # steps, catches, their text, and the picture that is made of it
        saving = self.weights * self.bytes
        return self.runs * self.evaluations * max(playing, writing, saving)

    @property
    def total(self) -> int:
        """Bytes at the peak."""
        return _BASE + self.kept + max(self.at_work, self.on_top)


def sizes_of(config: Config, runs: int) -> Sizes:
    """Of a batch of so many runs, which are equal but for their per-run values."""
    device = torch.device(config.machine.device)
    engine = make_engine(choose(config)[0], device)
    dtype: torch.dtype = getattr(torch, config.machine.dtype)
    # Tensors that have a shape, and no memory.
    candidates = torch.linspace(-1, 1, config.action.candidates, dtype=dtype, device="meta")
    network = make_value_network(config.value, candidates, runs=1)
    return Sizes(
        runs=runs,
        evaluations=config.situations // config.evaluation.every + 1,
        tests=len(config.evaluation.situations),
        weights=sum(weight.numel() for weight in network.parameters()),
        candidates=config.action.candidates,
        window=config.window if config.trace == "window" else 1,
        lanes=engine.workers * lanes_for(runs, engine.workers, engine.most_lanes),
        bytes=dtype.itemsize,
    )


def check_memory(config: Config, runs: int) -> str | None:
    """Refuse a batch that this machine's memory can't hold.

    Returns:
        One line for a batch that will take much of it; None for any other.

    Raises:
        ConfigError: it would need more than there is.
    """
    sizes, free = sizes_of(config, runs), available(config.machine.device)
    needs = (
        f"{runs:,} run{'s' if runs > 1 else ''} with {sizes.evaluations:,} evaluations "
        f"of {sizes.weights:,} weights each "
        f"and {sizes.candidates:,} candidate actions need about {_gigabytes(sizes.total)} of memory"
    )
    if sizes.total > free:
        raise ConfigError(f"{needs}, and {_gigabytes(free)} are free: {_smaller(config, sizes)}")
    return f"{needs}; {_gigabytes(free)} are free" if sizes.total > free * _MUCH else None


def _smaller(config: Config, sizes: Sizes) -> str:
    """What to make smaller, by what takes the most."""
    if sizes.at_work > max(sizes.kept, sizes.on_top):
        keys = ["action.candidates", "value"] + ["window"] * (config.trace == "window")
        return f"smaller {' or '.join(keys)} would do"
    return "fewer num_seeds, here or in each job of a sweep, or a larger evaluation.every would do"


def _gigabytes(count: float) -> str:
    return f"{count / 1e9:,.1f} GB"


def available(device: str = "cpu") -> float:
    """Bytes that this process can still get, infinitely many where the system doesn't say.

    Where the runs are on a GPU, that is what both it and the machine have left.
    """
    of_device = inf if device == "cpu" else torch.cuda.mem_get_info(device)[0]
    return min(_free_of_machine(), *_free_of_groups(), of_device)


def _free_of_machine() -> float:
    free = _read_number(Path("/proc/meminfo"), "MemAvailable:")
    if free is not None:
        return 1024 * free
    try:  # not Linux: nearly all of it
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return inf


def _free_of_groups(root: Path = _GROUPS, own: Path = _OWN_GROUPS) -> Iterator[float]:
    """What is left of the limits of each control group that this process is in (Linux)."""
    try:
        memberships = [line.split(":", 2) for line in own.read_text().splitlines()]
    except OSError:
        return
    for _, controllers, path in memberships:
        if controllers == "":
            top, limit, usage, cache = root, "memory.max", "memory.current", "inactive_file"
        elif "memory" in controllers.split(","):
            top, limit, usage = root / "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"
            cache = "total_inactive_file"
        else:
            continue
        group = top / path.lstrip("/")
        for folder in (group, *group.parents):
            most, used = _read_number(folder / limit), _read_number(folder / usage)
            if most is not None and used is not None:
                yield most - used + (_read_number(folder / "memory.stat", cache) or 0)
            if folder == top:
                break


def _read_number(path: Path, name: str = "") -> int | None:
    """The number in a file of the system, or that of the line that begins with a name."""
    try:
        lines = path.read_text().splitlines()
    except OSError:
        return None
    words = [line.split() for line in lines if line.startswith(name)]
    found = words[0][bool(name)] if words else ""
    return int(found) if found.isdecimal() else None
