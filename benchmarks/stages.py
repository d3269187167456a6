"""Run one train command in this process, and print the CPU seconds of each of its parts as JSON.

python benchmarks/stages.py lam=0.2 num_seeds=22 hydra.run.dir=/tmp/job
"""

import io
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from importlib import import_module
from typing import Any
from unittest.mock import patch

# In the order in which the command needs them, but for torch, which our own modules would import.
IMPORTS = {
    "importing torch and TorchRL": ["torch", "torchrl.envs", "torchrl.objectives"],
    "importing Hydra": ["hydra"],
    "importing our command line": ["fnnq_torchrl.launch.train"],
    "importing our training": ["fnnq_torchrl.training.job"],
    "importing Matplotlib": ["fnnq_torchrl.training.pictures.curves"],
}
# The functions that belong to each part, by the name under which they are called.
CALLS = {
    "composing and checking the configuration": ["fnnq_torchrl.launch.command._run"],
    "preparing": ["fnnq_torchrl.training.job.run_job"],
    "finding the programs": ["fnnq_torchrl.engine.choice.NativeLoop"],
    "learning and testing": ["fnnq_torchrl.training.trainer.work_through"],
    "writing the files": ["fnnq_torchrl.training.job._write"],
    "drawing the picture": ["fnnq_torchrl.training.job.draw_job"],
    "printing the table": ["fnnq_torchrl.training.job.print_summary"],
}


class Stopwatch:
    """A stopwatch of each part's CPU seconds, without those of the parts that it calls."""

    def __init__(self) -> None:
        self.seconds = Counter[str]()
        self._running: list[str] = []
        self._since = time.process_time()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        self._lap()
        self._running.append(name)
        try:
            yield
        finally:
            self._lap()
            self._running.pop()

    def timed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            with self.part(name):
                return function(*args, **kwargs)

        return call

    def _lap(self) -> None:
        now = time.process_time()
        if self._running:
            self.seconds[self._running[-1]] += now - self._since
        self._since = now


def main() -> None:
    from fnnq_torchrl.launch.imports import uncollected

    watch = Stopwatch()
    for name, modules in IMPORTS.items():
        with watch.part(name), uncollected():
            for module in modules:
                import_module(module)
    with ExitStack() as stack:
        for name, functions in CALLS.items():
            for path in functions:
                module, _, function = path.rpartition(".")
                timed = watch.timed(name, getattr(import_module(module), function))
                stack.enter_context(patch(path, timed))
        stack.enter_context(redirect_stdout(io.StringIO()))
        import_module("fnnq_torchrl.launch.train").main()
    print(json.dumps({name: watch.seconds[name] for name in [*IMPORTS, *CALLS]}))


if __name__ == "__main__":
    main()
