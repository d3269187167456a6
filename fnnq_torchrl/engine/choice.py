"""The choice of an engine: Python runs the steps one by one, or a loop compiled from them does."""

import logging
import os
from contextlib import AbstractContextManager
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch._subclasses.fake_tensor import DataDependentOutputException
from torch.fx.experimental.symbolic_shapes import GuardOnDataDependentSymNode

from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.engine.loops import EagerLoop, Loop, MakeLoop, MakeStep
from fnnq_torchrl.engine.native import (
    NativeLoop,
    RunsMixed,
    Unsupported,
    cache_directory,
    compiler,
    compiler_found,
)
from fnnq_torchrl.engine.threads import threads_for

_log = logging.getLogger(__name__)

_WORTH_COMPILING = {"cpu": 1_500, "cuda": 8_000}
"""Steps of a loop from which on compiling pays: at 4 ms an eager step, six and thirty seconds."""

_MEAN_SITUATION = 1 / 2
"""The mean length of an episode as a share of the time limit: a guess."""


@dataclass(frozen=True)
class Engine:
    """How to run steps, and on how many lanes.

    Attributes:
        name: ``eager`` or ``compiled``.
        why: which it is and why, in a line.
        make_loop: makes loops of steps.
        workers: threads that pay, each with lanes of its own. Eager steps have one: modules whose
            weights are replaced for a call can't be shared.
        most_lanes: more than so many at once are slower, since the cache doesn't hold them, or
            take too much memory.
    """

    name: str
    why: str
    make_loop: MakeLoop
    workers: int
    most_lanes: int

    def threads(self, elements: int) -> AbstractContextManager[None]:
        """Torch's own threads, for operations on so many elements, while this engine runs."""
        return threads_for(elements if self.name == "eager" else 0)


def choose_engine(config: Config, runs: int) -> Engine:
    """Return the engine for a batch of runs.

    ``engine=auto`` compares the work ahead with the time that compiling takes.

    Args:
        config: of the batch.
        runs: how many there are.

    Raises:
        ConfigError: it is to compile, and there is no C++ compiler.
    """
    device = torch.device(config.machine.device)
    if config.engine != "auto":
        return make_engine(config.engine, device, f"engine: {config.engine}, as asked for")
    if not compiler_found():
        return make_engine(
            "eager", device, "engine: eager, since there is no C++ compiler that works"
        )
    steps = int(config.situations * config.env.time_limit_steps * _MEAN_SITUATION)
    about = f"about {steps:,} steps of {runs:,} run{'s' if runs > 1 else ''}"
    if steps < _WORTH_COMPILING[device.type]:
        return make_engine("eager", device, f"engine: eager, since {about} are not worth compiling")
    return make_engine("compiled", device, f"engine: compiled, since {about} are worth it")


def make_engine(name: str, device: torch.device, why: str = "") -> Engine:
    """Return the engine of that name.

    Args:
        name: ``eager`` or ``compiled``.
        device: where the tensors are.
        why: a line that says why it is this one.

    Raises:
        ConfigError: it compiles, and there is no C++ compiler.
    """
    if name == "eager":
        return Engine(name, why, EagerLoop, workers=1, most_lanes=2**14)
    if not compiler_found():
        raise ConfigError(
            f"engine=compiled: needs a C++ compiler, and there is no {compiler()}; "
            "install one, name another in CXX, or take engine=eager"
        )
    if device.type == "cuda":
        return Engine(name, why, _inductor_loop, workers=1, most_lanes=2**17)
    return Engine(name, why, _native_loop, workers=torch.get_num_threads(), most_lanes=2**11)


def _native_loop(make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> Loop:
    """Written out or, if the step has an operation that can't be, compiled by Inductor."""
    try:
        return NativeLoop(make_step, stays, state)
    except RunsMixed as error:
        raise ConfigError(f"engine=compiled: {error}") from error
    except (DataDependentOutputException, GuardOnDataDependentSymNode) as error:
        raise ConfigError(
            "engine=compiled: a world or a value function looks at its data, as if does; "
            "torch.where doesn't, and engine=eager takes it as it is"
        ) from error
    except Unsupported as error:
        why, *_ = str(error).splitlines()
        _log.info("engine: compiled by TorchInductor, which takes longer: %s", why)
        return _inductor_loop(make_step, stays, state)


def _inductor_loop(make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> Loop:
    # Where later jobs find it: torch's own default is a temporary directory. By processor, since
    # machines may share a home, and torch takes one's programs for another's.
    cache = cache_directory() / "inductor" / torch.backends.cpu.get_cpu_capability()
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", str(cache))
    from fnnq_torchrl.engine.inductor import InductorLoop  # not before: it takes long to import

    return InductorLoop(make_step, stays, state)
