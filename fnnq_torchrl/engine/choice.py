"""Choose the engine that runs the steps: eager Python, or a compiled loop."""

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
    CannotCompile,
    NativeLoop,
    RunsMixed,
    Unsupported,
    cache_directory,
    check_compiler,
)
from fnnq_torchrl.engine.threads import threads_for

_log = logging.getLogger(__name__)

_WORTH_COMPILING = {"cpu": 1_500, "cuda": 8_000}
"""The least number of steps for which compiling pays: 6 s (CPU) and 32 s (GPU) of eager steps at
4 ms each."""

_MEAN_SITUATION = 1 / 2
"""The assumed mean length of an episode, as a share of the time limit."""


@dataclass(frozen=True)
class Engine:
    """A way to run steps, with the number of threads and lanes that suit it.

    A lane is the place of one run in a batch.

    Attributes:
        name: ``eager`` or ``compiled``.
        why: one line for the log: the engine's name and the reason for choosing it.
        make_loop: makes the loop that runs a step repeatedly.
        workers: the number of threads, each with its own lanes. The eager engine has one, because
            threads can't share a module whose weights are replaced during a call.
        most_lanes: the most lanes per worker. More would overflow the cache, which is slower, or
            take too much memory.
    """

    name: str
    why: str
    make_loop: MakeLoop
    workers: int
    most_lanes: int

    def threads(self, elements: int) -> AbstractContextManager[None]:
        """Return a context that sets torch's thread count for this engine.

        Args:
            elements: the size of the largest tensors in the block.
        """
        return threads_for(elements if self.name == "eager" else 0)


def choose_engine(config: Config, runs: int) -> Engine:
    """Return the engine for a batch of runs.

    ``engine=auto`` compares the work ahead with the time that compiling takes.

    Args:
        config: the configuration of the batch.
        runs: the number of runs.

    Raises:
        CannotCompile: if ``engine=compiled`` and nothing can be compiled here.
        ConfigError: if ``engine=compiled`` and the world can't be compiled.
    """
    device = torch.device(config.machine.device)
    if not config.env.compiles:
        if config.engine == "compiled":
            line = f"env={config.env.kind} isn't plain torch; take engine=eager"
            raise ConfigError(f"engine=compiled: {line}")
        return make_engine("eager", device, f"engine: eager, the only one for {config.env.kind}")
    if config.engine != "auto":
        return make_engine(config.engine, device, f"engine: {config.engine}, as asked for")
    of_situation = config.env.steps_of_situation
    if of_situation is None:
        of_situation = config.env.time_limit_steps * _MEAN_SITUATION
    steps = int(config.situations * of_situation)
    about = f"about {steps:,} steps of {runs:,} run{'s' if runs > 1 else ''}"
    if steps < _WORTH_COMPILING[device.type]:
        return make_engine("eager", device, f"engine: eager, since {about} are not worth compiling")
    try:
        return make_engine("compiled", device, f"engine: compiled, since {about} are worth it")
    except CannotCompile as error:
        return make_engine("eager", device, f"engine: eager, since {error.reason}")


def make_engine(name: str, device: torch.device, why: str = "") -> Engine:
    """Return the engine with a given name.

    Args:
        name: ``eager`` or ``compiled``.
        device: the tensors' device.
        why: one line for the log: the reason for choosing this engine.

    Raises:
        CannotCompile: if ``name`` is ``compiled`` and nothing can be compiled here.
    """
    if name == "eager":
        return Engine(name, why, EagerLoop, workers=1, most_lanes=2**14)
    check_compiler()
    if device.type == "cuda":
        return Engine(name, why, _inductor_loop, workers=1, most_lanes=2**17)
    return Engine(name, why, _native_loop, workers=torch.get_num_threads(), most_lanes=2**11)


def _native_loop(
    make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase, recipe: str | None = None
) -> Loop:
    """Compile a step to C++, or with TorchInductor if it has an operation we can't translate."""
    try:
        return NativeLoop(make_step, stays, state, recipe)
    except RunsMixed as error:
        raise ConfigError(f"engine=compiled: {error}") from error
    except (DataDependentOutputException, GuardOnDataDependentSymNode) as error:
        raise ConfigError(
            "engine=compiled: a world or another class of yours looks at its data, for example "
            "with if; write torch.where instead, or take engine=eager"
        ) from error
    except Unsupported as error:
        why, *_ = str(error).splitlines()
        _log.info("engine: compiled by TorchInductor, which takes longer: %s", why)
        return _inductor_loop(make_step, stays, state)


def _inductor_loop(
    make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase, recipe: str | None = None
) -> Loop:
    from torch._inductor.runtime.cache_dir_utils import default_cache_dir  # slow to import

    # Torch's default is a temporary directory, which later jobs wouldn't find; importing torch may
    # have set the variable to it. Each kind of processor has its own directory: machines may share
    # a home, and torch doesn't tell their programs apart.
    cache = cache_directory() / "inductor" / torch.backends.cpu.get_cpu_capability()
    if os.environ.get("TORCHINDUCTOR_CACHE_DIR") in (None, default_cache_dir()):
        os.environ["TORCHINDUCTOR_CACHE_DIR"] = str(cache)
    from fnnq_torchrl.engine.inductor import InductorLoop

    return InductorLoop(make_step, stays, state)
