"""What runs the steps: Python, one after the other, or a native loop compiled from them."""

import os
import shutil
import sys
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import torch

from fnnq_torchrl.config import Config, ConfigError
from fnnq_torchrl.loops import MakeLoop, eager_loop
from fnnq_torchrl.threads import threads_for

_WORTH_COMPILING = 8_000
"""Steps of a loop from which on compiling it pays: at 4 ms an eager step, half a minute."""

_MEAN_SITUATION = 1 / 2
"""Of the time limit: about how long a situation takes, between not at all and to the end."""


@dataclass(frozen=True)
class Engine:
    """How to run steps, and on how many lanes.

    Attributes:
        name: ``eager`` or ``compiled``.
        make_loop: makes loops of steps.
        workers: threads that pay, each with lanes of its own. Eager steps have one: modules whose
            weights are replaced for a call can't be shared.
        most_lanes: more than so many at once are slower, since the cache doesn't hold them, or
            take too much memory.
    """

    name: str
    make_loop: MakeLoop
    workers: int
    most_lanes: int

    def threads(self, elements: int) -> AbstractContextManager[None]:
        """Torch's own threads, for operations on so many elements, while this engine runs."""
        return threads_for(elements if self.name == "eager" else 0)


def make_engine(name: str, device: torch.device) -> Engine:
    """The engine of that name.

    Args:
        name: ``eager`` or ``compiled``.
        device: where the tensors are.

    Raises:
        ConfigError: it compiles, and there is no C++ compiler.
    """
    if name == "eager":
        return Engine(name, eager_loop, workers=1, most_lanes=2**14)
    if not compiler_found():
        raise ConfigError(
            f"engine=compiled: needs a C++ compiler, and there is no {_compiler()}; "
            "install one, name another in CXX, or take engine=eager"
        )
    _cache_where_later_jobs_find_it()
    from fnnq_torchrl.compiled import CompiledLoop  # not before: it takes long to import

    if device.type == "cuda":
        return Engine(name, CompiledLoop, workers=1, most_lanes=2**17)
    return Engine(name, CompiledLoop, workers=torch.get_num_threads(), most_lanes=2**11)


def choose(config: Config) -> tuple[str, str]:
    """The engine for a job, and one line that says which and why.

    ``auto`` compares the work ahead with the time that compiling takes.
    """
    if config.engine != "auto":
        return config.engine, f"engine: {config.engine}, as asked for"
    if not compiler_found():
        return "eager", "engine: eager, since there is no C++ compiler"
    steps = int(config.situations * config.env.time_limit_steps * _MEAN_SITUATION)
    about = f"about {steps:,} steps of {config.num_seeds:,} runs"
    if steps < _WORTH_COMPILING:
        return "eager", f"engine: eager, since {about} are not worth compiling"
    return "compiled", f"engine: compiled, since {about} are worth it (engine=eager begins at once)"


def compiler_found() -> bool:
    """Whether there is a C++ compiler, where torch looks for one."""
    return shutil.which(_compiler()) is not None


def _compiler() -> str:
    return os.environ.get("CXX") or ("clang++" if sys.platform == "darwin" else "g++")


def _cache_where_later_jobs_find_it() -> None:
    """Torch's own default is a temporary directory, which a reboot empties."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", str(home / "fnnq_torchrl" / "inductor"))
