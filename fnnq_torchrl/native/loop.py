"""A loop of steps as a native program of scalar operations."""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.graphs import leaves, nested, trace
from fnnq_torchrl.loops import MakeStep, Running, Step

from .aten import write_out
from .build import build
from .expressions import Expressions
from .source import Leaf, program

_MOST = 20_000
"""Scalar operations of a step: for more, a compiler takes minutes."""


class NativeLoop:
    """``steps`` times ``state = step(stays, state)``, in one native loop, for any number of lanes.

    The step is traced for a single run and written out, scalar by scalar. The program takes a
    vector of lanes through all their steps before it turns to the next, so that their states stay
    in registers and in the first-level cache; lanes never meet, and one computes what it would
    compute alone, bit for bit.

    Args:
        make_step: pure-tensor code; its Python runs once, when it is traced.
        stays: what the steps read and don't change.
        state: what they change.

    Raises:
        Unsupported: the step has an operation that isn't known here, or too many.
        ConfigError: the C++ compiler fails.
    """

    any_lanes = True

    def __init__(self, make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> None:
        self._run = build(source(make_step(1), stays[:1], state[:1]))

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        return _Running(self._run, stays, state)


class _Running:
    def __init__(
        self, run: Callable[..., Any], stays: TensorDictBase, state: TensorDictBase
    ) -> None:
        fixed, carried = leaves(stays), leaves(state)
        tensors = [*fixed.values(), *carried.values()]
        self._pointers = (ctypes.c_void_p * len(tensors))(*(leaf.data_ptr() for leaf in tensors))
        # Views: what the program does to the leaves is seen in the state, and the other way round.
        self.stays, self.state = nested(fixed, stays), nested(carried, state)
        self._run = run

    def advance(self, steps: int) -> None:
        self._run(len(self.state), steps, self._pointers)


def source(step: Step, stays: TensorDictBase, state: TensorDictBase) -> str:
    """The program's text.

    Args:
        step: for a single run.
        stays, state: of a single run.

    Raises:
        Unsupported: the step has an operation that isn't known here, or too many.
    """
    graph = trace(step, stays, state)
    fixed, carried = leaves(stays), leaves(state)
    tensors = [*fixed.values(), *carried.values()]
    make = Expressions(_MOST)
    inputs = [_elements(number, tensor, make) for number, tensor in enumerate(tensors)]
    outputs = [*inputs[: len(fixed)], *write_out(graph, inputs, make)]
    over = [*fixed, *carried].index("over") if "over" in carried else None
    return program(
        [
            Leaf(tensor.dtype, [*before.flat], [*after.flat])
            for tensor, before, after in zip(tensors, inputs, outputs, strict=True)
        ],
        over,
    )


def _elements(number: int, tensor: Tensor, make: Expressions) -> np.ndarray[Any, Any]:
    elements = np.empty(tensor.numel(), dtype=object)
    for element in range(tensor.numel()):
        elements[element] = make.input(number, element, tensor.dtype)
    return elements.reshape(tensor.shape)
