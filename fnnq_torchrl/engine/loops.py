"""The interface of loops that repeat a step, and the eager one.

A lane is the place of one run in a batch.
"""

from collections.abc import Callable
from typing import Protocol

from tensordict import TensorDictBase

from fnnq_torchrl.engine.threads import subnormals_flushed

Step = Callable[[TensorDictBase, TensorDictBase], TensorDictBase]
"""``step(stays, state)`` returns the next state; all have batch size ``[lanes]``.

``stays`` holds the tensors that steps read and don't change. The state may have an entry ``over``
(bool, ``[lanes, 1]``), which is true for a finished lane: it needs no further steps.
"""

MakeStep = Callable[[int], Step]
"""Makes the step for a number of lanes, since an environment has a fixed batch size."""


class Running(Protocol):
    """A batch that a loop is advancing.

    Attributes:
        stays, state: the batch's tensors, batch size ``[lanes]``. Callers may read them, and write
            them in place.
    """

    stays: TensorDictBase
    state: TensorDictBase

    def advance(self, steps: int) -> None:
        """Repeat ``state = step(stays, state)`` for a number of steps."""


class Loop(Protocol):
    """A loop around a step; calling it with a batch starts that batch.

    Attributes:
        any_lanes: whether a batch may have any multiple of :data:`.lanes.LANES` lanes; if not, it
            must have as many as the loop was made for.
    """

    any_lanes: bool

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        """Return copies of a batch, ready to advance."""


class MakeLoop(Protocol):
    """A function or a class that makes a loop around a step."""

    def __call__(
        self,
        make_step: MakeStep,
        stays: TensorDictBase,
        state: TensorDictBase,
        recipe: str | None = None,
        /,
    ) -> Loop:
        """Make a loop.

        Args:
            make_step: makes the step.
            stays, state: examples of the step's inputs, batch size ``[lanes]``.
            recipe: a text that, with this package's source code and the shapes of the examples,
                determines what the step computes. Steps with the same recipe can share a compiled
                program. None if no text can say it, because the step runs a user's own code.
        """


class EagerLoop:
    """A loop that runs the step's Python code, one operation after the other."""

    any_lanes = False

    def __init__(
        self,
        make_step: MakeStep,
        stays: TensorDictBase,
        state: TensorDictBase,
        recipe: str | None = None,
    ) -> None:
        self._step = make_step(len(state))

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        return _EagerlyRunning(self._step, stays.clone(), state.clone())


class _EagerlyRunning:
    def __init__(self, step: Step, stays: TensorDictBase, state: TensorDictBase) -> None:
        self._step, self.stays, self.state = step, stays, state

    def advance(self, steps: int) -> None:
        with subnormals_flushed():
            for _ in range(steps):
                self.state = self._step(self.stays, self.state)
                over = self.state.get("over", None)
                if over is not None and over.all():
                    break
