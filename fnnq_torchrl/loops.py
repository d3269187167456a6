"""A step, many times."""

from collections.abc import Callable

from tensordict import TensorDictBase

Step = Callable[[TensorDictBase, TensorDictBase], TensorDictBase]
"""From what stays and the state to the next state, all of batch size ``[lanes]``."""

Loop = Callable[[TensorDictBase, TensorDictBase, int], TensorDictBase]
"""The same, so many times."""

MakeLoop = Callable[[Step, TensorDictBase, TensorDictBase], Loop]
"""Makes a loop of a step, for what stays and a state like these."""


def eager_loop(step: Step, stays: TensorDictBase, state: TensorDictBase) -> Loop:
    """Step after step, each operation on its own; for any number of lanes."""

    def loop(stays: TensorDictBase, state: TensorDictBase, steps: int) -> TensorDictBase:
        for _ in range(steps):
            state = step(stays, state)
        return state

    return loop
