"""A step, many times."""

from collections.abc import Callable
from typing import Protocol

from tensordict import TensorDictBase

from fnnq_torchrl.engine.threads import subnormals_flushed

Step = Callable[[TensorDictBase, TensorDictBase], TensorDictBase]
"""From what stays and the state to the next state, all of batch size ``[lanes]``.

A state may have an entry ``over`` (bool, ``[lanes, 1]``): such a lane is ready, and need not be
stepped any further.
"""

MakeStep = Callable[[int], Step]
"""The step for so many lanes: environments know the size of their batch."""


class Running(Protocol):
    """Lanes that a loop has in its hands.

    Attributes:
        stays, state: theirs, batch size ``[lanes]``, to read and, in place, to write.
    """

    stays: TensorDictBase
    state: TensorDictBase

    def advance(self, steps: int) -> None:
        """Take so many steps, in each of which ``state`` becomes ``step(stays, state)``."""


class Loop(Protocol):
    """Runs a step again and again.

    Attributes:
        any_lanes: whether it takes any multiple of :data:`.lanes.LANES`, or only as
            many as it was made for.
    """

    any_lanes: bool

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        """Take lanes in hand: copies of these."""


MakeLoop = Callable[[MakeStep, TensorDictBase, TensorDictBase], Loop]
"""Makes a loop of a step, for what stays and a state like these."""


class EagerLoop:
    """Step after step, each operation on its own."""

    any_lanes = False

    def __init__(self, make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> None:
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
